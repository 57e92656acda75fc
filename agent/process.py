"""The loop of a drone's own process: hear the world, decide, answer. A thin shell around AgentCore.

It leaves when the world says BYE, when asked to (SIGTERM), or when the world has been silent for too long.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from agent.core import AgentCore, Inputs
from agent.radio.air import Air
from agent.radio.hearing import Hearing
from protocols.kernels import release_compiler
from protocols.mission.document import Mission, parse_mission
from protocols.wire import messages
from protocols.wire.sensed import SensedPacker, SensedReader, empty_sensed
from protocols.wire.status import AgentStatus

_LISTEN_S = 0.2
_STATUS_EVERY = 50  # ticks between accounts of itself when nothing changes

WORLD_SILENT = "the world has fallen silent"


class Link(Protocol):
    """Bytes to and from the world: agent.radio.link.AgentLink, or a test's."""

    def receive(self, timeout_s: float) -> bytes | None: ...

    def send(self, payload: bytes) -> None: ...


class Drone:
    """One drone of a welcomed process: turns TICK fields into a REPLY."""

    def __init__(
        self, mission: Mission, agent: int, initial_slots: bytes, boot: int, rehearsal: bool = False
    ) -> None:
        initial = np.frombuffer(initial_slots, np.uint8).astype(np.int16)[None]
        self.core = AgentCore(mission, [agent], initial, messages.MAX_HEARD, boot, rehearsal)
        self._sensed, self._air = empty_sensed(1), Air(mission.swarm, mission.agents, messages.MAX_HEARD + 1)
        self._sensors, self._hearing = (
            SensedReader(self._sensed),
            Hearing(self._air, agent, mission.agents),
        )
        self._awake, self._start = np.ones(1, np.bool_), np.zeros(2, np.int64)
        self.tick, self.slot = -1, int(initial[0, agent])

    @property
    def rejected(self) -> dict[str, int]:
        """Frames heard and not believed so far, by reason."""
        return self._hearing.rejected

    def answer(self, tick: int, packed: Any, sources: bytes, heard: list[bytes]) -> bytes:
        """One tick: what is sensed and heard (``sources[i]`` sent ``heard[i]``) in, the REPLY out."""
        self._sensors.read(packed)
        believed = self._hearing.hear(tick, sources, heard)
        self._start[1], own = len(believed), messages.MAX_HEARD
        said = self.core.tick(Inputs(tick, self._awake, self._sensed, self._air, self._start, believed, own))
        self.tick, self.slot = tick, int(said.slot[0])
        ((ax, ay),) = said.command.tolist()
        frame = self._air.pack(own) if said.sent[0] else None
        news = self.status() if said.changed or tick % _STATUS_EVERY == 0 else None
        return messages.pack(messages.REPLY, tick, ax, ay, self.slot, frame, news)

    def status(self) -> AgentStatus:
        """The drone's account of itself."""
        return self.core.status(0, self.tick, tuple(self.rejected.values()))

    def farewell(self) -> bytes:
        """The last REPLY."""
        return messages.pack(messages.REPLY, self.tick, 0.0, 0.0, self.slot, None, self.status())


def rehearse(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a drone needs, so that its first tick is not late."""
    drone = Drone(mission, 0, bytes(range(mission.agents)), 0, rehearsal=True)
    for tick in range(2):
        drone.answer(tick, SensedPacker(empty_sensed(1)).pack(0), b"", [])
    release_compiler()


def fly(link: Link, agent: int, leaving: Callable[[], bool]) -> str:
    """Take part in a flight as drone ``agent`` until it is over; return why it ended, for the log.

    Raises:
        protocols.mission.document.MissionError, agent.policy.PolicyError: the mission cannot be flown by this version.
    """
    link.send(messages.pack(messages.HELLO, messages.VERSION))
    drone: Drone | None = None
    silent_s = 0.0
    while not leaving():
        data = link.receive(_LISTEN_S)
        if data is None:
            silent_s += _LISTEN_S
            if silent_s >= messages.SILENCE_LIMIT_S:
                return WORLD_SILENT
            if drone is None:
                link.send(messages.pack(messages.HELLO, messages.VERSION))
            continue
        silent_s = 0.0
        kind, fields = messages.unpack(data)
        if kind == messages.TICK and drone is not None:
            link.send(drone.answer(*fields))
        elif kind == messages.WELCOME and drone is None:
            mission, initial_slots, boot = fields
            drone = Drone(parse_mission(mission, "the world's mission"), agent, initial_slots, boot)
            drone.core.open()
            link.send(messages.pack(messages.READY))
        elif kind == messages.BYE:
            if drone is not None:
                link.send(drone.farewell())
            return "the flight is over"
    return "asked to leave"
