"""A flight in real processes: one world, one process per drone, this process as their launcher.

The launcher loads and compiles everything once, forks the world and the drones, and then only watches: it hands on what
the world shows, does to processes what the mission says goes wrong with them, and names the drone whose process ends.
"""

import gc
import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

import psutil

from agent.policy import PolicyError
from agent.process import WORLD_SILENT, fly, rehearse
from agent.radio.link import AgentLink
from protocols.errors import BrokenError, ExitCode, SwarmError
from protocols.mission.document import Mission, parse_mission
from protocols.wire.keys import LinkError, Login
from rsc_swarm.flight.processes import Exit, Leave, Supervisor, leave_on_sigterm
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.flight.socket_folder import RunFolder
from world.core import WorldCore
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot
from world.server.link import Credentials, WorldLink
from world.server.session import Clock, Flown, NoControl, ServerError, WorldServer

_GRACE_S = 2.0
_WORLD = "world"
_POLICY_WENT_WRONG = int(ExitCode.BAD_USAGE)  # of a drone; the last line of its log says what happened


class RunBroken(BrokenError, RuntimeError):
    """The run itself broke, not the flight; one line says how."""


@dataclass(frozen=True)
class Launched:
    """A flight with the figures only the launcher knows. pss_mb: mean proportional memory of a drone's process."""

    flown: Flown
    first_tick_s: float
    pss_mb: float | None


class _Pipe:
    """The world's end of the launcher's pipe (world.server.session.Control)."""

    def __init__(self, pipe: Connection, leave: Leave) -> None:
        self._pipe, self._leave = pipe, leave

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        if kind in ("kill", "freeze", "thaw", "restart"):
            self._pipe.send(("apply", kind, agents))

    def lost(self) -> list[int]:
        agents = []
        while self._pipe.poll():
            agents.append(self._pipe.recv())
        return agents

    def show(self, picture: Snapshot) -> None:
        self._pipe.send(("show", picture))

    def leaving(self) -> bool:
        return self._leave.asked


def _world(
    mission: Mission,
    clock: Clock,
    credentials: Credentials,
    endpoint: str,
    pipe: Connection,
    trajectory: Path | None,
) -> None:
    """The world's process: flies the mission and sends what came of it down the pipe."""
    control = _Pipe(pipe, leave_on_sigterm())
    try:
        with WorldLink(credentials, [endpoint]) as link:
            recorder = Recorder(mission) if trajectory else None
            server = WorldServer(mission, link, clock, control, recorder.record if recorder else None)
            flown = server.run()
        if recorder and trajectory:
            recorder.save(trajectory)
        pipe.send(("flown", flown))
    except SwarmError as error:
        pipe.send(("broken", str(error)))


def _agent(agent: int, endpoint: str, login: Login) -> None:
    """A drone's process. It works in bursts, and waking up must not push the world off its core: that is batch scheduling."""
    with suppress(OSError):  # not everywhere allowed
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    gc.set_threshold(100_000)  # a tick leaves no cycles behind
    leave = leave_on_sigterm()
    try:
        with AgentLink(endpoint, login) as link:
            print(f"agent {agent}: {fly(link, agent, lambda: leave.asked)}", flush=True)
    except PolicyError as error:
        print(error, flush=True)
        raise SystemExit(_POLICY_WENT_WRONG) from None


def _name(agent: int) -> str:
    return f"agent-{agent}"


class _Launch:
    """One launch under way."""

    def __init__(
        self,
        mission: Mission,
        clock: Clock,
        logs: Path | None,
        trajectory: Path | None,
        supervisor: Supervisor,
        folder: RunFolder,
    ) -> None:
        self._mission, self._logs, self._supervisor, self._folder = mission, logs, supervisor, folder
        self._credentials = Credentials.fresh(mission.swarm, mission.agents)
        self._pipe, theirs = Pipe()
        self._expected: set[str] = set()  # ends that this launcher brought about
        self._start(_WORLD, _world, mission, clock, self._credentials, folder.endpoint, theirs, trajectory)
        theirs.close()
        for agent in range(mission.agents):
            self._start_agent(agent)

    def _start(self, name: str, target: Callable[..., object], *args: object) -> None:
        log = self._log(name)
        if name == _WORLD:  # it may finish its record, and then removes the run's folder
            self._supervisor.start(
                name, target, *args, log=log, at_launcher_death=signal.SIGTERM, run_folder=self._folder.path
            )
        else:
            self._supervisor.start(name, target, *args, log=log)

    def _log(self, name: str) -> Path:
        return (self._logs or self._folder.path) / f"{name}.log"

    def _start_agent(self, agent: int) -> None:
        self._start(_name(agent), _agent, agent, self._folder.endpoint, self._credentials.login(agent))

    def watch(self, on_snapshot: Callable[[Snapshot], None], weigh: bool) -> tuple[Flown, float | None]:
        """Serve the world until it says what came of the flight.

        Raises:
            RunBroken: the world said so, or ended without a word.
            agent.policy.PolicyError: a drone's policy raised.
        """
        pss: float | None = None
        while True:
            if self._pipe.poll(0.05):
                try:
                    message = self._pipe.recv()
                except EOFError:
                    message = ("silent",)
                if message[0] == "show":
                    on_snapshot(message[1])
                    if weigh and pss is None and message[1].tick > 100:
                        pss = self._weigh()
                elif message[0] == "apply":
                    self._apply(message[1], message[2])
                elif message[0] == "flown":
                    return message[1], pss
                elif message[0] == "broken":
                    raise RunBroken(f"{message[1]}{self._first_complaint()}")
                else:
                    ended = self._supervisor.wait(1.0, [_WORLD])
                    end = next((exit_ for exit_ in ended if exit_.name == _WORLD), None)
                    raise RunBroken(f"{end or 'the world closed its pipe'}{self._first_complaint()}")
            self._report_ends(self._supervisor.poll())

    def _report_ends(self, ends: list[Exit]) -> None:
        for end in ends:
            if end.name == _WORLD or end.name in self._expected:
                self._expected.discard(end.name)
                continue
            if end.code == _POLICY_WENT_WRONG:
                raise PolicyError(self._log(end.name).read_text(errors="replace").splitlines()[-1])
            try:
                self._pipe.send(int(end.name.removeprefix("agent-")))
            except OSError:
                return  # the world is gone; its pipe says so

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
                    self._expected.add(name)
                    self._supervisor.kill(name)
                    while name in self._supervisor.running:
                        self._report_ends(self._supervisor.wait(0.1, [name]))
                if kind == "restart":
                    self._start_agent(agent)

    def _weigh(self) -> float:
        """Mean proportional set size of the drones' processes, MB."""
        sizes = [
            psutil.Process(self._supervisor.pid(name)).memory_full_info().pss
            for name in self._supervisor.running
            if name != _WORLD
        ]
        return sum(sizes) / max(len(sizes), 1) / 1e6

    def _first_complaint(self) -> str:
        """The first line any process wrote about its end, for the one-line error."""
        for log in sorted((self._logs or self._folder.path).glob("*.log")):
            for line in log.read_text(errors="replace").splitlines():
                if "Error" in line:
                    return f" ({line})"
        return ""


def warm_up(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a flight needs, before forking."""
    simulation = Simulation([mission.model_copy(update={"faults": ()})], rehearsal=True)
    simulation.tick()
    rehearse(mission)


def launch(
    mission: Mission,
    clock: Clock = "lockstep",
    run_dir: Path | None = None,
    on_snapshot: Callable[[Snapshot], None] = lambda picture: None,
    weigh: bool = False,
) -> Launched:
    """Fly ``mission`` in one process per drone.

    Args:
        run_dir: an existing folder for ``logs/`` and ``trajectory.npz``.
        weigh: measure the drones' memory once in mid-flight.

    Raises:
        RunBroken: the run itself broke. world.field.FieldError, agent.policy.PolicyError: the mission cannot be flown.
        KeyboardInterrupt: after all processes have ended.
    """
    warm_up(mission)
    logs = run_dir / "logs" if run_dir else None
    if logs:
        logs.mkdir(exist_ok=True)
    with RunFolder() as folder, Supervisor() as supervisor:
        run = _Launch(
            mission, clock, logs, run_dir / "trajectory.npz" if run_dir else None, supervisor, folder
        )
        flown, pss = run.watch(on_snapshot, weigh)
        supervisor.stop(_GRACE_S)
    born = psutil.Process(os.getpid()).create_time()
    return Launched(flown, flown.first_tick_at - born, pss)


def serve_world(
    mission: Mission,
    clock: Clock,
    listen: list[str],
    login_folder: Path,
    on_snapshot: Callable[[Snapshot], None] = lambda picture: None,
    record: Callable[[WorldCore], None] | None = None,
    join_s: float = 120.0,
) -> Flown:
    """Be the world alone: write one login file per drone into ``login_folder``, wait for all drones, fly.

    Raises:
        RunBroken: it cannot listen there, or drones did not come.
    """
    warm_up(mission)
    leave = leave_on_sigterm()
    credentials = Credentials.fresh(mission.swarm, mission.agents)
    login_folder.mkdir(parents=True, exist_ok=True)
    for agent in range(mission.agents):
        credentials.save_login(agent, login_folder / f"{_name(agent)}.json")
    try:
        with WorldLink(credentials, listen) as link:
            control = NoControl(lambda: leave.asked, on_snapshot)
            return WorldServer(mission, link, clock, control, record, join_s).run()
    except (ServerError, LinkError) as error:
        raise RunBroken(str(error)) from None


def _login(file: Path) -> Login:
    try:
        return Login.from_json(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunBroken(f"{file}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # UnicodeDecodeError is one
        text = "is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error)
        raise RunBroken(f"{file}: {text}") from None


def fly_agent(
    agent: int, endpoint: str, login_file: Path, on_ready: Callable[[float], None] = lambda seconds: None
) -> str:
    """Be one drone alone, as on its companion computer; return why the flight ended.

    Raises:
        RunBroken: no world there, the login is refused or unreadable, or the world fell silent.
        agent.policy.PolicyError: the policy cannot be had here, or raised.
    """
    leave = leave_on_sigterm()
    try:
        login = _login(login_file)
        rehearse(parse_mission({"agents": 4}))
        with AgentLink(endpoint, login, leaving=lambda: leave.asked) as link:
            on_ready(time.time() - psutil.Process().create_time())
            reason = fly(link, agent, lambda: leave.asked)
    except PolicyError:
        raise
    except (LinkError, ValueError) as error:
        if leave.asked:
            return str(error)
        raise RunBroken(str(error)) from None
    if reason == WORLD_SILENT:
        raise RunBroken(f"agent {agent}: {reason}")
    return reason
