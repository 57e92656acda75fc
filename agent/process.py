"""The loop of a drone's own process: hear the world, decide, answer. A thin shell around AgentCore.

It leaves when the world says BYE, when asked to (SIGTERM), or when the world has been silent for too long.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from agent.core import AgentCore
from agent.memory import forget
from agent.radio.hearing import Hearing
from protocols.kernels import release_compiler
from protocols.mission.document import Mission, parse_mission
from protocols.slots.agreement import SlotNote, encode
from protocols.slots.notes import quiet_note
from protocols.wire import messages
from protocols.wire.frames import FrameCodec, empty_frames, swarm_tag
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
        sensed, frames = empty_sensed(1), empty_frames(messages.MAX_HEARD + 1)
        self.core = AgentCore(
            mission, [agent], initial, sensed, frames, messages.MAX_HEARD, boot, rehearsal=rehearsal
        )
        self._sensors = SensedReader(sensed)
        self._codec = FrameCodec(swarm_tag(mission.swarm), frames)
        self._hearing = Hearing(self.core, self._codec)
        self.tick = -1

    @property
    def rejected(self) -> dict[str, int]:
        """Frames heard and not believed so far, by reason."""
        return self._hearing.rejected

    def answer(self, tick: int, packed: Any, sources: bytes, heard: list[bytes]) -> bytes:
        """One tick: what is sensed and heard (``sources[i]`` sent ``heard[i]``) in, the REPLY out."""
        if self.tick < 0:
            forget(self.core.memory, 0, tick)
        self.tick = tick
        self._sensors.read(packed)
        core = self.core
        self._hearing.hear(tick, sources, heard)
        ((ax, ay),) = core.step(tick, messages.MAX_HEARD).tolist()
        frame = self._speak() if core.work.sent[0] else None
        return messages.pack(
            messages.REPLY, tick, ax, ay, core.endpoints.endpoint[0].slot, frame, self._news(tick)
        )

    def _speak(self) -> bytes:
        out, frames = messages.MAX_HEARD, self.core.frames
        if not frames.loud[out]:
            return self._codec.encode(out, quiet_note(int(frames.digest[out])))
        note = self.core.notes[out]
        assert isinstance(note, SlotNote)
        return self._codec.encode(out, encode(note))

    def status(self) -> AgentStatus:
        """The drone's account of itself."""
        return self.core.status(0, self.tick, tuple(self.rejected.values()))

    def _news(self, tick: int) -> AgentStatus | None:
        """Its account when its view of the slots changed, and now and then."""
        endpoints = self.core.endpoints
        if not endpoints.changed and tick % _STATUS_EVERY != 0:
            return None
        return self.status()

    def farewell(self) -> bytes:
        """The last REPLY."""
        return messages.pack(
            messages.REPLY, self.tick, 0.0, 0.0, self.core.endpoints.endpoint[0].slot, None, self.status()
        )


def rehearse(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a drone needs, so that its first tick is not late."""
    drone = Drone(mission, 0, bytes(range(mission.agents)), 0, rehearsal=True)
    for tick in range(2):
        drone.answer(tick, SensedPacker(empty_sensed(1)).pack(0), b"", [])
    drone.core.load_rare_kernels()
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
