"""Many drones on one host, a process each, for a world that is elsewhere.

This process loads everything once, forks the drones, and then only watches: it names the drone that ends, and ends all when it is
asked to leave. They do not outlive it. It never opens Zenoh.
"""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

from agent.body.relayed import Ending
from protocols.errors import ExitCode, SwarmError
from protocols.mission.document import parse_mission
from protocols.wire.keys import user
from protocols.wire.login import Login
from rsc_swarm.flight.alone import refuse_unsealed, take_part
from rsc_swarm.flight.processes import Exit, Start, Supervisor, be_drone
from rsc_swarm.flight.warm_up import warm_up_drone
from rsc_swarm.machine.census import age_s
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.machine.limits import make_room
from rsc_swarm.machine.service import Service

_GRACE_S = 5.0
_LOOK_S = 0.2
_LONGEST = 2000  # bytes of a line that a drone says: what is written into a pipe at once, arrives at once
_READY = "ready"


class Ended(NamedTuple):
    """A drone's process has ended, and why. code: 0 after a flight, else as the command's."""

    agent: int
    code: int
    why: str


def fly_agents(
    logins: Sequence[Login], endpoint: str, policy: str, join_s: float,
    on_ready: Callable[[float], None], on_end: Callable[[Ended], None],
) -> ExitCode:  # fmt: skip
    """Be these drones, a process each, and fly ``policy``, until each has ended: how it went, as the command's exit code.

    Args:
        join_s: how long each looks for the world. on_ready: told, when all have joined, after how many seconds of this process.
        on_end: told of each that has ended.

    Raises:
        rsc_swarm.flight.launch.RunBroken: a login is good for no flight.
        rsc_swarm.machine.limits.MachineError: the machine gives too little.
        agent.policy.PolicyError: the policy cannot be had here.
    """
    for login in logins:
        refuse_unsealed(login)
    make_room(len(logins))
    warm_up_drone(parse_mission({"agents": 4, "policy": policy}))
    service, said = Service(), _Said()
    with leave_when_asked() as leave, Supervisor(_GRACE_S) as supervisor:
        supervisor.start_all(
            [Start(user(login.agent), _fly_one, (login, endpoint, policy, join_s, said)) for login in logins]
        )
        service.ready(f"{len(logins)} drones, looking for the world at {endpoint}")
        ready, codes = False, list[int]()
        while supervisor.running:
            if service.alive(leave.asked):
                supervisor.stop(_GRACE_S)
                return ExitCode.INTERRUPTED
            ends = supervisor.wait(_LOOK_S)
            said.read()
            if not ready and len(said.ready) == len(logins):
                ready = True
                on_ready(age_s())
            for end in ends:
                ended = _explained(end, said)
                codes.append(ended.code)
                on_end(ended)
    wrong = [code for code in codes if code]
    return ExitCode(wrong[0]) if wrong else ExitCode.SUCCEEDED


class _Said:
    """A pipe in which drones say, a line each, that they are ready and why they ended."""

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        self._rest = b""
        self.ready: set[int] = set()
        self.ends: dict[int, str] = {}

    def say(self, agent: int, what: str) -> None:
        """In a drone's process."""
        with suppress(OSError):
            os.write(self._writer, f"{agent} {' '.join(what.split())}".encode()[:_LONGEST] + b"\n")

    def read(self) -> None:
        """Take in what has been said by now."""
        with suppress(BlockingIOError):
            while more := os.read(self._reader, 65_536):
                self._rest += more
        *lines, self._rest = self._rest.split(b"\n")
        for line in lines:
            agent, _, what = line.decode(errors="replace").partition(" ")
            if what == _READY:
                self.ready.add(int(agent))
            else:
                self.ends[int(agent)] = what


def _fly_one(login: Login, endpoint: str, policy: str, join_s: float, said: _Said) -> None:
    """A drone's process."""
    leave = be_drone()
    try:
        ending = take_part(
            login, endpoint, policy, lambda: leave.asked, join_s, lambda: said.say(login.agent, _READY)
        )
    except SwarmError as error:
        said.say(login.agent, str(error))
        raise SystemExit(int(error.exit_code)) from None
    said.say(login.agent, ending)
    if ending is Ending.ASKED_TO_LEAVE:
        raise SystemExit(int(ExitCode.BROKEN))  # it alone was


def _explained(end: Exit, said: _Said) -> Ended:
    agent = int(end.name.removeprefix("agent-"))
    code = ExitCode.BROKEN if end.code not in (ExitCode.SUCCEEDED, ExitCode.BAD_USAGE) else end.code
    return Ended(agent, int(code), said.ends.get(agent) or f"its process ({end.pid}) {end.how}")
