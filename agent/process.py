"""The loop of a drone's own process: hear the world, decide, answer. A thin shell around AgentCore.

It leaves when the world says Bye, when asked to (SIGTERM), or when the world has been silent for too long.
"""

import secrets
from collections.abc import Callable
from typing import Protocol

import numpy as np

from agent.core import AgentCore, Inputs
from agent.radio.air import Air
from agent.radio.hearing import Hearing
from protocols.kernels import release_compiler
from protocols.mission.document import Mission, parse_mission
from protocols.wire import messages
from protocols.wire.keys import LinkError
from protocols.wire.messages import (
    Bye,
    Farewell,
    Hello,
    MessageError,
    Ready,
    Refused,
    Reply,
    Tick,
    Wait,
    Welcome,
)
from protocols.wire.sensed import SensedPacker, SensedReader, empty_sensed
from protocols.wire.status import AgentStatus, is_due

_LISTEN_S = 0.2

WORLD_SILENT = "the world has fallen silent"


class Link(Protocol):
    """Bytes to and from the world: agent.radio.link.AgentLink, or a test's."""

    def receive(self, timeout_s: float) -> bytes | None: ...

    def send(self, payload: bytes) -> None: ...


class Drone:
    """One drone of a welcomed process: turns a Tick into a Reply."""

    def __init__(self, mission: Mission, agent: int, welcome: Welcome, rehearsal: bool = False) -> None:
        """Drone ``agent``; ``welcome`` says who is in which slot, and how often it was restarted. ``mission``: its, parsed."""
        initial = np.frombuffer(welcome.initial_slots, np.uint8).astype(np.int16)[None]
        self._process = welcome.process
        self.core = AgentCore(mission, [agent], initial, messages.MAX_HEARD, welcome.boot, rehearsal)
        self._sensed, self._air = empty_sensed(1), Air(mission.swarm, mission.agents, messages.MAX_HEARD + 1)
        self._sensors = SensedReader(self._sensed)
        self._hearing = Hearing(self._air, agent, mission.agents)
        self._awake, self._start = np.ones(1, np.bool_), np.zeros(2, np.int64)
        self.tick = -1

    @property
    def rejected(self) -> dict[str, int]:
        """Frames heard and not believed so far, by reason."""
        return self._hearing.rejected

    def answer(self, asked: Tick) -> Reply:
        """One tick: what is sensed and heard in, what it does and says out."""
        tick, own = asked.tick, messages.MAX_HEARD
        self._sensors.read(asked.sensed)
        believed = self._hearing.hear(tick, asked.sources, asked.heard)
        self._start[1] = len(believed)
        said = self.core.tick(Inputs(tick, self._awake, self._sensed, self._air, self._start, believed, own))
        self.tick = tick
        ((ax, ay),) = said.command.tolist()
        frame = self._air.pack(own) if said.sent[0] else None
        news = self.status() if is_due(tick, bool(said.changed)) else None
        return Reply(self._process, tick, ax, ay, int(said.slot[0]), frame, news)

    def status(self) -> AgentStatus:
        """The drone's account of itself."""
        return self.core.status(0, self.tick, tuple(self.rejected.values()))

    def farewell(self) -> Farewell:
        """Its last word."""
        return Farewell(self._process, self.status())


def rehearse(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a drone needs, so that its first tick is not late."""
    drone = Drone(mission, 0, Welcome(0, {}, bytes(range(mission.agents)), 0), rehearsal=True)
    for tick in range(2):
        drone.answer(Tick(tick, SensedPacker(empty_sensed(1)).pack(0), b"", []))
    release_compiler()


def fly(
    link: Link, agent: int, leaving: Callable[[], bool], silence_s: float = messages.SILENCE_LIMIT_S
) -> str:
    """Take part in a flight as drone ``agent`` until it is over; return why it ended, for the log.

    Args:
        silence_s: leave when the world has said nothing for this long. Counted in this process's own running time: a pause of it
            is no silence of the world.

    Raises:
        protocols.wire.keys.LinkError: the world refuses this process.
        protocols.mission.document.MissionError, agent.policy.PolicyError: the mission cannot be flown by this version.
    """
    hello = Hello(messages.VERSION, secrets.randbelow(messages.MAX_PROCESS))
    link.send(messages.pack(hello))
    drone: Drone | None = None
    silent_s = 0.0
    while not leaving():
        data = link.receive(_LISTEN_S)
        if data is None:
            silent_s += _LISTEN_S
            if silent_s >= silence_s:
                return WORLD_SILENT
            if drone is None:
                link.send(messages.pack(hello))
            continue
        silent_s = 0.0
        try:
            message = messages.unpack_from_world(data)
        except MessageError:
            continue
        if isinstance(message, Tick):
            if drone is not None:  # else it is for another process with this login
                link.send(messages.pack(drone.answer(message)))
        elif isinstance(message, Welcome):
            if drone is None and message.process == hello.process:
                drone = Drone(parse_mission(message.mission, "the world's mission"), agent, message)
                drone.core.open()
                link.send(messages.pack(Ready(hello.process)))
        elif isinstance(message, Wait):
            if drone is not None:
                link.send(messages.pack(Ready(hello.process)))
        elif isinstance(message, Refused):
            if message.process == hello.process:
                raise LinkError(message.why)
        elif isinstance(message, Bye):
            if drone is not None:
                link.send(messages.pack(drone.farewell()))
            return "the flight is over"
    return "asked to leave"
