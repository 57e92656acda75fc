"""A recorded flight as an MCAP file, which Foxglove, Rerun and PlotJuggler open (docs/recordings.md).

Positions, transforms, the scene and the log have Foxglove's own schemas, as Protobuf, because Rerun knows no others; what has no
such schema is JSON with a schema of its own. The time is that of the flight, from 0 on.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from protocols.errors import SwarmError
from protocols.mission.document import mission_yaml
from protocols.whole_file import whole_file
from rsc_swarm.flight.events import Event
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.flight.report import FlightReport
from rsc_swarm.show.foxglove.carried import FATES, carried_in
from rsc_swarm.show.foxglove.scene import FRAME, Scene
from world.outlets.judged import findings_of

_EVERY_S, _SCENE_EVERY_S = 0.05, 0.1
_BAD = ("kill", "lost", "collision")
_ODD = ("freeze", "restart", "slow", "part", "lie")
_NUMBER, _INTEGER, _TRUTH = {"type": "number"}, {"type": "integer"}, {"type": "boolean"}
_DRONE = {
    "agent": _INTEGER, "flying": _TRUTH, "slot": _INTEGER, "x_m": _NUMBER, "y_m": _NUMBER, "vx_mps": _NUMBER,
    "vy_mps": _NUMBER, "speed_mps": _NUMBER, "nearest_m": {"type": ["number", "null"]}, "edge_error": _NUMBER,
}  # fmt: skip
_LINK = {
    "type": "object",
    "properties": {"source": _INTEGER, "destination": _INTEGER, **dict.fromkeys(FATES, _TRUTH)},
}
_FIGURES = {
    "flying": _INTEGER, "worst_edge_error": _NUMBER, "worst_slot_error_m": _NUMBER,
    "nearest_m": {"type": ["number", "null"]}, "mean_speed_mps": _NUMBER,
}  # fmt: skip


class McapError(SwarmError, RuntimeError):
    """No MCAP file can be made; one line says why."""


def write_mcap(recorded: Recorded, out: Path) -> None:
    """Write a flight as an MCAP file; it is complete or it is not there.

    Raises:
        McapError: what writes such files is missing. protocols.whole_file.WriteError: it cannot be written.
    """
    check_mcap()
    with whole_file(out) as file:
        _Mcap(recorded, file).write()


def check_mcap() -> None:
    """Look whether such files can be written here.

    Raises:
        McapError: the packages for it are missing.
    """
    if not all(find_spec(name) for name in ("foxglove_schemas_protobuf", "mcap", "mcap_protobuf")):
        raise McapError(
            "--mcap: needs the extra mcap: pip install mcap mcap-protobuf-support foxglove-schemas-protobuf"
        )


class _Mcap:
    """One file on its way."""

    def __init__(self, recorded: Recorded, file: Any) -> None:
        from mcap.writer import Writer

        self._recorded, self._path = recorded, recorded.path
        self._writer: Any = Writer(file)
        self._channels: dict[str, int] = {}
        self._often, self._seldom = (
            max(1, round(every / recorded.path.tick_s)) for every in (_EVERY_S, _SCENE_EVERY_S)
        )
        self._carried = carried_in(recorded, self._seldom)
        self._drawn = Scene(recorded, self._carried)

    def write(self) -> None:
        """All of it, in the order of time."""
        recorded, path = self._recorded, self._path
        self._writer.start(library=f"rsc-swarm {version('rsc-swarm')}")
        self._writer.add_attachment(
            0, 0, "mission.yaml", "application/yaml", mission_yaml(recorded.mission).encode()
        )
        findings = findings_of(path, recorded.mission)
        events = [*recorded.events]
        for row in range(len(path.slots)):
            last = row == len(path.slots) - 1
            while events and (events[0].tick <= row or last):
                self._event(events.pop(0))
            if row % self._often == 0 or last:
                self._poses(row)
                self._figures(row, findings)
            if row % self._seldom == 0 or last:
                self._scene(row)
        if recorded.report:
            self._json("/report", "rsc_swarm.FlightReport", FlightReport.model_json_schema(), len(path.slots) - 1,
                       recorded.report.model_dump(mode="json"))  # fmt: skip
        self._writer.finish()

    def _ns(self, row: int) -> int:
        return round(row * self._path.tick_s * 1e9)

    def _say(self, topic: str, message: Any, row: int) -> None:
        """One message of Foxglove's."""
        from mcap_protobuf.schema import register_schema

        if topic not in self._channels:
            schema = register_schema(self._writer, type(message))
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        at = self._ns(row)
        self._writer.add_message(self._channels[topic], at, message.SerializeToString(), at)

    def _json(
        self, topic: str, name: str, schema: Mapping[str, Any], row: int, message: Mapping[str, Any]
    ) -> None:
        if topic not in self._channels:
            number = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        at = self._ns(row)
        self._writer.add_message(self._channels[topic], at, json.dumps(message, allow_nan=False).encode(), at)

    def _stamp(self, row: int) -> Any:
        from google.protobuf.timestamp_pb2 import Timestamp

        made = Timestamp()
        made.FromNanoseconds(self._ns(row))
        return made

    def _event(self, event: Event) -> None:
        from foxglove_schemas_protobuf.Log_pb2 import Log

        self._json("/events", "rsc_swarm.Event", TypeAdapter(Event).json_schema(), event.tick, asdict(event))
        level = Log.ERROR if event.what in _BAD else Log.WARNING if event.what in _ODD else Log.INFO
        text = f"{event.text} ({event.why})" if event.why else event.text
        self._say(
            "/log",
            Log(timestamp=self._stamp(event.tick), level=level, message=text, name=event.what),
            event.tick,
        )

    def _poses(self, row: int) -> None:
        from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
        from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
        from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame

        stamp = self._stamp(row)
        poses = [self._pose(row, agent) for agent in range(self._path.slots.shape[1])]
        self._say("/poses", PosesInFrame(timestamp=stamp, frame_id=FRAME, poses=poses), row)
        transforms = [
            FrameTransform(
                timestamp=stamp, parent_frame_id=FRAME, child_frame_id=f"drone_{agent}",
                translation=pose.position, rotation=pose.orientation,
            )
            for agent, pose in enumerate(poses)
        ]  # fmt: skip
        self._say("/tf", FrameTransforms(transforms=transforms), row)

    def _pose(self, row: int, agent: int) -> Any:
        """Where a drone is, and where it flies to."""
        from foxglove_schemas_protobuf.Pose_pb2 import Pose

        x, y = self._path.positions[row, agent].tolist()
        vx, vy = self._path.velocities[row, agent].tolist()
        half = np.arctan2(vy, vx) / 2 if vx or vy else 0.0
        position: Any = {"x": x, "y": y}
        orientation: Any = {"z": float(np.sin(half)), "w": float(np.cos(half))}
        return Pose(position=position, orientation=orientation)

    def _figures(self, row: int, findings: Any) -> None:
        path, seen = self._path, findings.verdict[row]
        speeds = np.linalg.norm(path.velocities[row], axis=1)
        flying = path.flying[row]
        near = min(float(seen["closest_agents_m"]), float(seen["closest_obstacle_m"]))
        drones = [
            {
                "agent": agent, "flying": bool(flying[agent]), "slot": int(path.slots[row, agent]),
                "x_m": float(path.positions[row, agent, 0]), "y_m": float(path.positions[row, agent, 1]),
                "vx_mps": float(path.velocities[row, agent, 0]), "vy_mps": float(path.velocities[row, agent, 1]),
                "speed_mps": float(speeds[agent]), "nearest_m": _finite(findings.nearest[row, agent]),
                "edge_error": float(findings.edge_error[row, agent]),
            }
            for agent in range(len(speeds))
        ]  # fmt: skip
        listed = {"type": "array", "items": {"type": "object", "properties": _DRONE}}
        self._json(
            "/drones",
            "rsc_swarm.Drones",
            {"type": "object", "properties": {"drones": listed}},
            row,
            {"drones": drones},
        )
        self._json(
            "/figures", "rsc_swarm.Figures", {"type": "object", "properties": _FIGURES}, row,
            {
                "flying": int(flying.sum()), "worst_edge_error": float(seen["edge_error"]),
                "worst_slot_error_m": float(seen["slot_error_m"]), "nearest_m": _finite(near),
                "mean_speed_mps": float(speeds[flying].mean()) if flying.any() else 0.0,
            },
        )  # fmt: skip

    def _scene(self, row: int) -> None:
        self._say("/scene", self._drawn.at(row, self._stamp(row)), row)
        if self._carried:
            schema = {"type": "object", "properties": {"links": {"type": "array", "items": _LINK}}}
            self._json("/links", "rsc_swarm.Links", schema, row, {"links": self._carried.told(row)})


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
