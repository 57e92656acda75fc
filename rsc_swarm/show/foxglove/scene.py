"""The scene of a flight, as Foxglove draws it in three dimensions: obstacles, drones with their numbers, the tree, the radio."""

import colorsys
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.mission.formation import NO_PARENT
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.show.foxglove.carried import Carried

FRAME = "mission"  #: x forward, y left, as in the recording
_TALL_M, _BALL_M = 2.0, 0.6


class Scene:
    """Draws the moments of one flight."""

    def __init__(self, recorded: Recorded, carried: Carried | None = None) -> None:
        """``carried``: what became of its frames, if that is known."""
        self._recorded, self._path, self._carried = recorded, recorded.path, carried
        agents = recorded.mission.agents
        self._colours = [
            colorsys.hsv_to_rgb(0.65 * (1 - agent / max(1, agents - 1)), 0.75, 0.85)
            for agent in range(agents)
        ]

    def at(self, row: int, stamp: Any) -> Any:
        """The foxglove.SceneUpdate of this row, whose time is ``stamp``; the first one draws the field."""
        from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

        self._stamp = stamp
        tree = self._lines("tree", row, self._tree(row), (0.1, 0.1, 0.1, 0.9), 0.08)
        radio = self._lines("radio", row, self._links(row), (0.2, 0.5, 0.9, 0.35), 0.03)
        lost = self._lines("radio_lost", row, self._lost(row), (0.8, 0.2, 0.1, 0.35), 0.03)
        field = [self._field()] if row == 0 else []
        return SceneUpdate(entities=[*field, self._drones(row), tree, radio, lost])

    def _entity(self, name: str, **parts: Any) -> Any:
        from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity

        return SceneEntity(timestamp=self._stamp, frame_id=FRAME, id=name, **parts)

    def _field(self) -> Any:
        """Obstacles with their numbers, and the goal line."""
        path = self._path
        low, high = path.positions[:, :, 1].min() - 5.0, path.positions[:, :, 1].max() + 5.0
        discs = path.obstacles.tolist()
        cylinders = [
            {
                "pose": _place(x, y, _TALL_M / 2), "size": {"x": 2 * radius, "y": 2 * radius, "z": _TALL_M},
                "bottom_scale": 1, "top_scale": 1, "color": _colour(0.32, 0.38, 0.43, 0.9),
            }
            for x, y, radius in discs
        ]  # fmt: skip
        texts = [_text(f"obstacle {number}", x, y, z=_TALL_M + 0.4) for number, (x, y, _) in enumerate(discs)]
        goal = _line_list([((path.goal_x, low), (path.goal_x, high))], (0.1, 0.1, 0.1, 1.0), 0.1)
        return self._entity("field", cylinders=cylinders, texts=texts, lines=[goal])

    def _drones(self, row: int) -> Any:
        path = self._path
        there = np.flatnonzero(path.flying[row]).tolist()
        spheres = [
            {
                "pose": _place(*path.positions[row, agent].tolist()), "size": {"x": _BALL_M, "y": _BALL_M, "z": _BALL_M},
                "color": _colour(*self._colours[agent], 1.0),
            }
            for agent in there
        ]  # fmt: skip
        texts = [_text(str(agent), *map(float, path.positions[row, agent]), z=_BALL_M) for agent in there]
        return self._entity("drones", spheres=spheres, texts=texts)

    def _lines(
        self, name: str, row: int, pairs: Iterable[tuple[int, int]], colour: tuple[float, ...], thick: float
    ) -> Any:
        at = self._path.positions[row]
        ends = [(tuple(at[a].tolist()), tuple(at[b].tolist())) for a, b in pairs]
        return self._entity(name, lines=[_line_list(ends, colour, thick)] if ends else [])

    def _tree(self, row: int) -> Iterator[tuple[int, int]]:
        """Followers and their leaders, by who holds the slots."""
        parent = self._recorded.mission.layout.parent
        holder = {
            int(self._path.slots[row, agent]): agent
            for agent in np.flatnonzero(self._path.flying[row]).tolist()
        }
        for slot, agent in holder.items():
            if parent[slot] != NO_PARENT and int(parent[slot]) in holder:
                yield agent, holder[int(parent[slot])]

    def _links(self, row: int) -> Iterable[tuple[int, int]]:
        """Drones of whom one heard the other; where that is not known, those within radio range of each other and not parted."""
        if self._carried:
            return self._carried.with_fate(row, "carried")
        mission, path = self._recorded.mission, self._path
        group = _groups(self._recorded, row)
        near = (
            np.linalg.norm(path.positions[row][:, None] - path.positions[row][None], axis=2)
            <= mission.radio.range_m
        )
        near &= path.flying[row][:, None] & path.flying[row][None] & (group[:, None] == group[None])
        return [(one, other) for one, other in np.argwhere(np.triu(near, 1)).tolist()]

    def _lost(self, row: int) -> Iterable[tuple[int, int]]:
        """Drones of whom one did not hear what the other said."""
        return self._carried.with_fate(row, "lost") if self._carried else []


def _groups(recorded: Recorded, row: int) -> NDArray[np.int64]:
    """(N,) the radio group of every drone."""
    group = np.zeros(recorded.mission.agents, np.int64)
    for fault in sorted(recorded.mission.faults, key=lambda fault: fault.at_tick):
        if fault.at_tick <= row and fault.kind in ("part", "heal"):
            group[:] = 0
            for number, agents in enumerate(fault.groups, start=1):
                group[list(agents)] = number
    return group


def _colour(red: float, green: float, blue: float, alpha: float) -> dict[str, float]:
    return {"r": red, "g": green, "b": blue, "a": alpha}


def _place(x: float, y: float, z: float = 0.0) -> dict[str, dict[str, float]]:
    return {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}}


def _text(text: str, x: float, y: float, *, z: float) -> dict[str, Any]:
    return {
        "pose": _place(x, y, z),
        "billboard": True,
        "font_size": 0.8,
        "color": _colour(0.1, 0.1, 0.1, 1.0),
        "text": text,
    }


def _line_list(ends: list[tuple[Any, Any]], colour: tuple[float, ...], thick: float) -> dict[str, Any]:
    from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive

    points = [{"x": float(x), "y": float(y)} for pair in ends for x, y in pair]
    red, green, blue, alpha = colour
    return {
        "type": LinePrimitive.LINE_LIST, "pose": _place(0.0, 0.0), "thickness": thick, "points": points,
        "color": _colour(red, green, blue, alpha),
    }  # fmt: skip
