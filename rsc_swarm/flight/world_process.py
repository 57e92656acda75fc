"""The world's process in a launch, and the pipe between it and the launcher.

world -> launcher   ("gathered", drones that are ready)  ("show", snapshot)  ("so far", figures)
                    ("apply", kind, agents)  ("broken", one line)
                    ("flown", figures), then ("saved", None or why the path could not be saved)
launcher -> world   ("started", agent, pid)  ("ended", agent, how)

Should the world be killed, the launcher has the figures of a second ago. Should the launcher be killed, the world leaves, and
keeps what was flown in its place.
"""

import select
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

import psutil

from protocols.errors import SwarmError
from protocols.mission.document import Mission
from protocols.whole_file import WriteError
from rsc_swarm.flight.processes import launcher_died, leave_on_sigterm
from rsc_swarm.machine.census import process
from world.outcome import Flown
from world.outlets.onlooker import Onlooker
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot
from world.server.credentials import Credentials
from world.server.link import WorldLink
from world.server.ports import STRUCK_OFF, Lost
from world.server.session import Clock, WorldServer

_STOPPED = (psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP)
_SO_FAR_EVERY_S = 1.0
JOIN_S = 60.0  # patience for all to find each other: here they are there, however busy the machine is


class PipeControl:
    """The launcher, as the world sees it (world.server.ports.Control)."""

    watches = True

    def __init__(self, pipe: Connection, leaving: Callable[[], bool]) -> None:
        self._pipe = pipe
        self._said = select.poll()  # looked at every tick: the pipe's own poll costs twenty times this
        self._said.register(pipe.fileno(), select.POLLIN)
        self._asked, self._alone = leaving, False
        self._pid: dict[int, int] = {}
        self._so_far_at = 0.0
        self.so_far: Callable[[], Flown] | None = None

    def leaving(self) -> bool:
        """Asked, or without a launcher."""
        return self._alone or self._asked()

    def tell(self, *what: object) -> None:
        """Tell the launcher, if it is there."""
        try:
            self._pipe.send(what)
        except OSError:
            self._alone = True

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        if kind in ("kill", "freeze", "thaw", "restart", STRUCK_OFF):
            self.tell("apply", kind, agents)

    def lost(self) -> list[Lost]:
        lost: list[Lost] = []
        while not self._alone and self._said.poll(0):
            try:
                what, agent, value = self._pipe.recv()
            except (EOFError, OSError):
                self._alone = True
                break
            if what == "started":
                self._pid[agent] = value
            else:
                lost.append(Lost(agent, value))
        return lost

    def paused(self, agent: int) -> bool:
        try:
            return process(self._pid[agent]).status() in _STOPPED
        # OSError: somebody has opened all the files that this process may open.
        except (KeyError, psutil.NoSuchProcess, OSError):
            return False

    def gathered(self, ready: int) -> None:
        self.tell("gathered", ready)

    def show(self, picture: Snapshot) -> None:
        # First the figures: of whatever was shown, there is something to report.
        if self.so_far and (now := time.monotonic()) >= self._so_far_at:
            self._so_far_at = now + _SO_FAR_EVERY_S
            self.tell("so far", self.so_far())
        self.tell("show", picture)


class Inside(NamedTuple):
    """What is called in the world's process. keep: should the launcher be killed, the last chance to keep what was flown, as it
    would have done. onlooker: looks on while the flight lasts."""

    keep: Callable[[Flown], object] = lambda flown: None
    onlooker: Onlooker | None = None


NOTHING_INSIDE = Inside()


def be_world(
    mission: Mission,
    clock: Clock,
    credentials: Credentials,
    endpoint: str,
    pipe: Connection,
    run_dir: Path | None,
    inside: Inside,
) -> None:
    """Fly the mission, send what came of it down the pipe, then save every drone's path, however the flight ended.

    Args:
        run_dir: where; None: nowhere.
    """
    leave = leave_on_sigterm()
    recorder = Recorder(mission) if run_dir else None
    control = PipeControl(pipe, lambda: leave.asked)
    try:
        with WorldLink(credentials, [endpoint]) as link:
            record = recorder.record if recorder else None
            server = WorldServer(mission, link, clock, control, record, JOIN_S, inside.onlooker)
            control.so_far = server.flown
            flown = server.run()
        control.tell("flown", flown)
        unsaved = save_path(recorder, run_dir, flown)
        control.tell("saved", unsaved)
        if launcher_died():
            inside.keep(flown)
    except SwarmError as error:
        save_path(recorder, run_dir, error)
        control.tell("broken", str(error))


def save_path(recorder: Recorder | None, run_dir: Path | None, ended: Flown | SwarmError) -> str | None:
    """Save what was recorded, if anything was flown, and the events; why that cannot be done. ended: what was flown, or
    what broke it."""
    if recorder is None or run_dir is None or recorder.rows < 2:  # the first is of the start
        return None
    from rsc_swarm.flight.events import End, end_of  # loaded only where something is kept, after the flight
    from rsc_swarm.flight.run_dir import RunDir

    end = End("broken", str(ended)) if isinstance(ended, SwarmError) else end_of(ended, recorder.mission)
    try:
        RunDir(run_dir).save_path(recorder.trajectory, recorder.mission, end)
    except WriteError as error:
        return str(error)
    return None
