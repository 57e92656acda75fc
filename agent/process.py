"""The loop of a drone's own process: hear the world, decide, answer. A thin shell around AgentCore.

It leaves when the world says BYE, when asked to (SIGTERM), or when the world has been silent for too long.
"""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from agent.core import AgentCore
from agent.memory import forget
from protocols import messages
from protocols.frames import REASONS, FrameError, FrameReader, empty_frames, encode_frame, swarm_tag
from protocols.mission import Mission, parse_mission
from protocols.sensed import SensedReader, empty_sensed, pack_sensed
from protocols.status import AgentStatus
from protocols.swap import SlotNote, decode, encode
from protocols.swap_notes import quiet_digest

_LISTEN_S = 0.2
_OLDEST_FRAME = 200  # ticks; the medium delays no frame longer
_STATUS_EVERY = 50  # ticks between accounts of itself when nothing changes


class Link(Protocol):
    """Bytes to and from the world: agent.link.AgentLink, or a test's."""

    def receive(self, timeout_s: float) -> bytes | None: ...

    def send(self, payload: bytes) -> None: ...


class Drone:
    """One drone of a welcomed process: turns TICK fields into a REPLY."""

    def __init__(
        self, mission: Mission, agent: int, initial_slots: bytes, boot: int, rehearsal: bool = False
    ) -> None:
        initial = np.frombuffer(initial_slots, np.uint8).astype(np.int16)[None]
        self.rejected = dict.fromkeys(REASONS, 0)
        self._mission, self._agent = mission, agent
        self._tag = swarm_tag(mission.swarm)
        self._sensed = empty_sensed(1)
        self._sensors = SensedReader(self._sensed)
        self._frames = empty_frames(messages.MAX_HEARD + 1)
        self.core = AgentCore(
            mission,
            [agent],
            initial,
            self._sensed,
            self._frames,
            messages.MAX_HEARD,
            boot,
            rehearsal=rehearsal,
        )
        self.core.work.inbox[:] = np.arange(messages.MAX_HEARD)
        self._reader = FrameReader(self._tag, mission.agents, self._frames)
        self.tick = -1

    def answer(self, tick: int, packed: Any, sources: bytes, heard: list[bytes]) -> bytes:
        """One tick: what is sensed and heard (``sources[i]`` sent ``heard[i]``) in, the REPLY out.

        Bad frames, and those in which a drone speaks in another's name, are counted and dropped.
        """
        if self.tick < 0:
            forget(self.core.memory, 0, tick)
        self.tick = tick
        self._sensors.read(packed)
        core = self.core
        core.work.inbox_start[1] = self._hear(tick, sources, heard)
        ((ax, ay),) = core.step(tick, messages.MAX_HEARD).tolist()
        frame = self._speak() if core.work.sent[0] else None
        return messages.pack(
            messages.REPLY, tick, ax, ay, core.parties.party[0].slot, frame, self._news(tick)
        )

    def _hear(self, tick: int, sources: bytes, heard: list[bytes]) -> int:
        """Read the frames into rows 0, 1, ...; return how many are good."""
        row = 0
        for source, data in zip(sources[: messages.MAX_HEARD], heard, strict=False):
            try:
                sender, note = self._reader.read(data, tick, _OLDEST_FRAME, row)
                if sender != source or sender == self._agent:
                    raise FrameError("sender")
                self._keep_note(row, note)
            except FrameError as error:
                self.rejected[error.reason] += 1
                continue
            row += 1
        return row

    def _keep_note(self, row: int, encoded: Any) -> None:
        digest = quiet_digest(encoded)
        if digest is not None:
            self._frames.digest[row] = digest
            self._frames.loud[row] = 0
            return
        try:
            note = decode(encoded, self._mission.agents)
        except (ValueError, TypeError) as error:
            raise FrameError("malformed") from error
        self.core.notes[row] = note
        self._frames.digest[row] = note.digest
        self._frames.loud[row] = not (note.quiet and note.settled)

    def _speak(self) -> bytes:
        out, frames = messages.MAX_HEARD, self._frames
        if frames.loud[out]:
            note = self.core.notes[out]
            assert isinstance(note, SlotNote)
        else:
            note = SlotNote(int(frames.digest[out]), True)
        return encode_frame(self._tag, frames, out, encode(note))

    def status(self) -> AgentStatus:
        """The drone's account of itself."""
        return self.core.status(0, self.tick, tuple(self.rejected.values()))

    def _news(self, tick: int) -> AgentStatus | None:
        """Its account when its view of the slots changed, and now and then."""
        parties = self.core.parties
        if not parties.changed and tick % _STATUS_EVERY != 0:
            return None
        return self.status()

    def farewell(self) -> bytes:
        """The last REPLY."""
        return messages.pack(
            messages.REPLY, self.tick, 0.0, 0.0, self.core.parties.party[0].slot, None, self.status()
        )


def rehearse(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel a drone needs, so that its first tick is not late."""
    drone = Drone(mission, 0, bytes(range(mission.agents)), 0, rehearsal=True)
    for tick in range(2):
        drone.answer(tick, pack_sensed(empty_sensed(1), 0), b"", [])
    drone.core.load_rare_kernels()


def fly(link: Link, agent: int, leaving: Callable[[], bool]) -> str:
    """Take part in a flight as drone ``agent`` until it is over; return why it ended, for the log.

    Raises:
        protocols.mission.MissionError, agent.policy.PolicyError: the mission cannot be flown by this version.
    """
    link.send(messages.pack(messages.HELLO, messages.VERSION))
    drone: Drone | None = None
    silent_s = 0.0
    while not leaving():
        data = link.receive(_LISTEN_S)
        if data is None:
            silent_s += _LISTEN_S
            if silent_s >= messages.SILENCE_LIMIT_S:
                return "the world has fallen silent"
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
