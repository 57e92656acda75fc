"""A flight in real processes: one world, one process per drone, this process as their launcher.

The launcher loads and compiles everything once, forks the world and the drones, and then only watches: it hands on what
the world shows, does to processes what the mission says goes wrong with them, and names the drone whose process ends.
"""

import math
import signal
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import psutil

from agent.policy import PolicyError
from agent.process import fly
from agent.radio.link import AgentLink
from protocols.errors import BrokenError, ExitCode, SwarmError
from protocols.mission.document import Mission
from protocols.wire.login import Login
from rsc_swarm.flight.busy import answer, busy_at, explained
from rsc_swarm.flight.processes import Exit, Start, Supervisor, be_drone
from rsc_swarm.flight.socket_folder import RunFolder
from rsc_swarm.flight.warm_up import warm_up_launch
from rsc_swarm.flight.world_process import JOIN_S, NOTHING_INSIDE, Inside, be_world
from rsc_swarm.machine.census import born_at, process
from rsc_swarm.machine.leaving import Leave, leave_when_asked
from rsc_swarm.machine.limits import make_room
from world.outcome import Flown
from world.outlets.snapshot import Snapshot
from world.server.credentials import Credentials
from world.server.ports import STRUCK_OFF
from world.server.session import Clock

_GRACE_S = 2.0
_SAVING_S = 60.0  # patience for a world that was asked to leave
_WORLD = "world"
_POLICY_WENT_WRONG = int(
    ExitCode.BAD_USAGE
)  # of a drone; the last line of its log says, after this, what happened
_POLICY_SAID = "its policy went wrong: "


class RunBroken(BrokenError, RuntimeError):
    """The run itself broke, not the flight; one line says how."""


@dataclass(frozen=True)
class Launched:
    """A flight with the figures only the launcher knows.

    pss_mb: mean proportional memory of a drone's process. unsaved: why every drone's path could not be written.
    error: what broke the run in mid-flight.
    """

    flown: Flown
    first_tick_s: float
    pss_mb: float | None
    unsaved: str | None
    error: SwarmError | None = None

    def whole(self) -> Flown:
        """The flight, for who flies several in a row; raises ``error`` if there is one, KeyboardInterrupt if it was stopped."""
        if self.error:
            raise self.error
        if self.flown.outcome.failure == "interrupted":
            raise KeyboardInterrupt
        return self.flown


AgentProcess = Callable[[int, str, Login, str], None]  # agent, endpoint, login, policy


def _agent(agent: int, endpoint: str, login: Login, policy: str) -> None:
    """A drone's process. However long the world is silent, it stays: its launcher ends it."""
    leave = be_drone()
    answer()
    try:
        with AgentLink(endpoint, login, JOIN_S, lambda: leave.asked) as link:
            over = fly(link, agent, policy, lambda: leave.asked, math.inf, login.seals)
            print(f"agent {agent}: {over}", flush=True)
    except PolicyError as error:
        print(f"{_POLICY_SAID}{error}", flush=True)
        raise SystemExit(_POLICY_WENT_WRONG) from None


def _name(agent: int) -> str:
    return f"agent-{agent}"


def _lines(log: Path) -> list[str]:
    """What a process wrote; nothing where it could not write."""
    with suppress(OSError):
        return log.read_text(errors="replace").splitlines()
    return []


class _Launch:
    """One launch under way."""

    def __init__(
        self,
        mission: Mission,
        clock: Clock,
        logs: Path | None,
        keeping: tuple[Path | None, Inside],
        supervisor: Supervisor,
        folder: RunFolder,
        insiders: Mapping[int, AgentProcess],
    ) -> None:
        self._insiders = insiders
        self._mission, self._logs, self._supervisor, self._folder = mission, logs, supervisor, folder
        self._credentials = Credentials.fresh(mission.swarm, mission.agents)
        self._pipe, theirs = Pipe()
        self._expected: set[str] = set()  # ends that this launcher brought about
        self.pss_mb: float | None = None
        self._so_far: Flown | None = None
        self._error: SwarmError | None = None
        self._busy: dict[int, str] = {}  # drone that was struck off -> where its policy was
        self._supervisor.start(  # it may finish its record, and then removes the run's folder
            _WORLD, be_world, mission, clock, self._credentials, folder.endpoint, theirs, *keeping,
            log=self._log(_WORLD), at_launcher_death=signal.SIGCONT, run_folder=folder.path,
        )  # fmt: skip
        theirs.close()
        self._start_agents(*range(mission.agents))

    def _log(self, name: str) -> Path:
        return (self._logs or self._folder.path) / f"{name}.log"

    def _start_agents(self, *agents: int) -> None:
        starts = [
            Start(
                _name(agent),
                self._insiders.get(agent, _agent),
                (agent, self._folder.endpoint, self._credentials.login(agent), self._mission.policy),
                self._log(_name(agent)),
            )
            for agent in agents
        ]
        for agent, pid in zip(agents, self._supervisor.start_all(starts), strict=True):
            self._tell("started", agent, pid)

    def _tell(self, what: str, agent: int, value: object) -> None:
        with suppress(OSError):  # the world is gone; its pipe says so
            self._pipe.send((what, agent, value))

    def watch(
        self,
        on_gathered: Callable[[int], None],
        on_snapshot: Callable[[Snapshot], None],
        weigh: bool,
        leave: Leave,
    ) -> tuple[Flown, str | None, SwarmError | None]:
        """Serve the world until it has said what came of the flight and saved it.

        Returns:
            What was flown, why it could not be saved, and what broke the run.

        Raises:
            RunBroken, agent.policy.PolicyError, KeyboardInterrupt: before anything was flown.
        """
        flown: Flown | None = None
        deadline = math.inf
        unsaved: str | None = f"the world has not saved the flight within {_SAVING_S:g} s"
        while time.monotonic() < deadline:
            if (leave.asked or self._error) and deadline == math.inf:
                deadline = time.monotonic() + _SAVING_S
                self._supervisor.ask(_WORLD)
            what, *said = self._hear()
            if what == "gathered":
                on_gathered(said[0])
            elif what == "show":
                on_snapshot(said[0])
                if weigh and self.pss_mb is None and said[0].tick > 100:
                    self.pss_mb = self._weigh()
            elif what == "so far":
                self._so_far = said[0]
            elif what == "apply":
                self._apply(*said)
            elif what == "flown":
                flown = explained(said[0], self._busy)
            elif what == "saved":
                unsaved = said[0]
                break
            elif what == "broken":
                unsaved = None
                if not leave.asked:
                    broken = RunBroken(f"{said[0]}{self._first_complaint(said[0])}")
                    self._error = self._error or broken
                break
            elif what == "silent":
                why = self._why_silent()
                unsaved = f"{why}, before it had saved the flight" if flown else None
                self._error = self._error or (None if flown else RunBroken(why))
                break
            self._report_ends(self._supervisor.poll())
        flown = flown or self._so_far
        if flown is None:
            # Who is asked to leave ends the world, maybe before that one can answer: that breaks nothing.
            raise KeyboardInterrupt if leave.asked or not self._error else self._error
        return flown, unsaved, self._error

    def _hear(self) -> tuple[Any, ...]:
        """What the world says, or ("nothing",)."""
        try:
            said: tuple[Any, ...] = self._pipe.recv() if self._pipe.poll(0.05) else ("nothing",)
        except (EOFError, OSError):
            return ("silent",)
        return said

    def _why_silent(self) -> str:
        ended = self._supervisor.wait(1.0, [_WORLD])
        end = next((exit_ for exit_ in ended if exit_.name == _WORLD), None)
        why = str(end or "the world closed its pipe")
        return f"{why}{self._first_complaint(why)}"

    def _report_ends(self, ends: list[Exit]) -> None:
        for end in ends:
            if end.name == _WORLD or end.name in self._expected:
                self._expected.discard(end.name)
                continue
            log = _lines(self._log(end.name))
            if end.code == _POLICY_WENT_WRONG and log and log[-1].startswith(_POLICY_SAID):
                self._error = self._error or PolicyError(log[-1].removeprefix(_POLICY_SAID))
            complaint = next((line for line in log if line.startswith(f"{end.name}: ")), "")
            how = f"its process ({end.pid}) {end.how}{complaint and f' ({complaint})'}"
            self._tell("ended", int(end.name.removeprefix("agent-")), how)

    def _apply(self, kind: str, agents: tuple[int, ...]) -> None:
        for agent in agents:
            name = _name(agent)
            if name not in self._supervisor.running and kind != "restart":
                continue
            if kind == "freeze":
                self._supervisor.freeze(name)
            elif kind == "thaw":
                self._supervisor.thaw(name)
            else:
                if name in self._supervisor.running:
                    if kind == STRUCK_OFF and (place := busy_at(self._supervisor.pid(name), self._log(name))):
                        self._busy[agent] = place
                    self._expected.add(name)
                    self._supervisor.kill(name)
                    while name in self._supervisor.running:
                        self._report_ends(self._supervisor.wait(0.1, [name]))
                if kind == "restart":
                    self._start_agents(agent)

    def _weigh(self) -> float | None:
        """Mean proportional set size of the drones' processes, MB; None: none can be weighed."""
        sizes = []
        for name in self._supervisor.running:
            if name != _WORLD:
                with suppress(psutil.NoSuchProcess):  # it has just ended, or /proc does not tell of it
                    sizes.append(process(self._supervisor.pid(name)).memory_full_info().pss)
        return sum(sizes) / len(sizes) / 1e6 if sizes else None

    def _first_complaint(self, known: str) -> str:
        """The first line any process wrote about its end, for the one-line error; nothing if that is ``known``."""
        for log in sorted((self._logs or self._folder.path).glob("*.log")):
            for line in _lines(log):
                if "Error" in line:
                    return "" if line in known else f" ({line})"
        return ""


def launch(
    mission: Mission,
    clock: Clock = "lockstep",
    run_dir: Path | None = None,
    on_snapshot: Callable[[Snapshot], None] = lambda picture: None,
    weigh: bool = False,
    inside: Inside = NOTHING_INSIDE,
    insiders: Mapping[int, AgentProcess] = {},
    on_gathered: Callable[[int], None] = lambda ready: None,
) -> Launched:
    """Fly ``mission`` in one process per drone.

    Args:
        run_dir: an existing folder for ``logs/``, ``trajectory.npz`` and ``events.jsonl``.
        weigh: measure the drones' memory once in mid-flight.
        insiders: what the processes of some drones do instead of flying honestly.
        on_gathered: called with the number of drones that are ready, until all are.
        inside: what is called in the world's process.

    Raises:
        RunBroken: the run itself broke before the first tick; later that is the launch's ``error``.
        rsc_swarm.machine.limits.MachineError: the machine gives too little.
        world.field.FieldError, agent.policy.PolicyError: the mission cannot be flown.
        KeyboardInterrupt: asked to leave (Ctrl-C, SIGTERM) before the first tick; later that ends the flight as interrupted, and
            what was flown is told and saved like any other.
    """
    make_room(mission.agents)
    warm_up_launch(mission)
    logs = run_dir / "logs" if run_dir else None
    if logs:
        logs.mkdir(exist_ok=True)
    keeping = (run_dir, inside)
    with leave_when_asked() as leave, RunFolder() as folder, Supervisor() as supervisor:
        run = _Launch(mission, clock, logs, keeping, supervisor, folder, insiders)
        flown, unsaved, error = run.watch(on_gathered, on_snapshot, weigh, leave)
        supervisor.stop(_GRACE_S)
    return Launched(flown, flown.first_tick_at - born_at(), run.pss_mb, unsaved if run_dir else None, error)
