"""The world's process in a launch, and the pipe between it and the launcher.

world -> launcher   ("show", snapshot)  ("apply", kind, agents)  ("broken", one line)
                    ("flown", figures), then ("saved", None or why the path could not be saved)
launcher -> world   ("started", agent, pid)  ("ended", agent, how)
"""

from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import psutil

from protocols.errors import SwarmError
from protocols.mission.document import Mission
from protocols.whole_file import WriteError
from rsc_swarm.flight.processes import leave_on_sigterm
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot
from world.server.credentials import Credentials
from world.server.link import WorldLink
from world.server.ports import Lost
from world.server.session import Clock, WorldServer

_STOPPED = (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)


class PipeControl:
    """The launcher, as the world sees it (world.server.ports.Control)."""

    def __init__(self, pipe: Connection, leaving: Callable[[], bool]) -> None:
        self._pipe = pipe
        self.leaving = leaving
        self._pid: dict[int, int] = {}

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        if kind in ("kill", "freeze", "thaw", "restart"):
            self._pipe.send(("apply", kind, agents))

    def lost(self) -> list[Lost]:
        lost = []
        while self._pipe.poll():
            what, agent, value = self._pipe.recv()
            if what == "started":
                self._pid[agent] = value
            else:
                lost.append(Lost(agent, value))
        return lost

    def paused(self, agent: int) -> bool:
        try:
            return psutil.Process(self._pid[agent]).status() in _STOPPED
        except (KeyError, psutil.NoSuchProcess):
            return False

    def show(self, picture: Snapshot) -> None:
        self._pipe.send(("show", picture))


def be_world(
    mission: Mission,
    clock: Clock,
    credentials: Credentials,
    endpoint: str,
    pipe: Connection,
    trajectory: Path | None,
) -> None:
    """Fly the mission, send what came of it down the pipe, then save every drone's path, however the flight ended."""
    leave = leave_on_sigterm()
    recorder = Recorder(mission) if trajectory else None
    try:
        with WorldLink(credentials, [endpoint]) as link:
            control = PipeControl(pipe, lambda: leave.asked)
            server = WorldServer(mission, link, clock, control, recorder.record if recorder else None)
            flown = server.run()
        pipe.send(("flown", flown))
        pipe.send(("saved", save_path(recorder, trajectory)))
    except SwarmError as error:
        save_path(recorder, trajectory)
        pipe.send(("broken", str(error)))


def save_path(recorder: Recorder | None, trajectory: Path | None) -> str | None:
    """Save what was recorded, if anything was; why that cannot be done."""
    if recorder is None or trajectory is None or not recorder.rows:
        return None
    try:
        recorder.save(trajectory)
    except WriteError as error:
        return str(error)
    return None
