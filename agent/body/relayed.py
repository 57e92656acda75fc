"""A drone whose nature is a server: each Tick brings all that reaches it, each Reply takes all that it does.

`RelayedWorld` is its body and its radio, without input and output; `WorldClock`, over a link, is its clock: it takes part in the
flight until the world says Bye, until the world has been silent for too long, or until the process is asked to leave.
"""

import secrets
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import Protocol

from agent.ports import Heard
from protocols.wire import messages
from protocols.wire.keys import LinkError
from protocols.wire.messages import (
    Bye,
    Farewell,
    FromDrone,
    FromWorld,
    Hello,
    MessageError,
    Ready,
    Refused,
    Reply,
    Tick,
    Wait,
    Welcome,
)
from protocols.wire.sensed import Sensed, SensedReader, empty_sensed
from protocols.wire.status import AgentStatus

_LISTEN_S = 0.2
_LOOKS = 5  # that bring nothing: then it says that it is there, and is asked again what was lost on the way
_MOST_LOOKS = 1000  # and no more: the pipe to a world that is stopped is not to fill up


class Ending(StrEnum):
    """Why a flight is over for a drone's process."""

    OVER = "the flight is over"
    WORLD_SILENT = "the world has fallen silent"
    ASKED_TO_LEAVE = "asked to leave"


class Link(Protocol):
    """Bytes to and from the world: agent.radio.link.AgentLink, or a test's."""

    def receive(self, timeout_s: float) -> bytes | None: ...

    def send(self, payload: bytes) -> None: ...


class RelayedWorld:
    """Body and radio (agent.ports) of the drone that is flown by process number ``process``."""

    def __init__(self, process: int) -> None:
        self._process = process
        self._sensed = empty_sensed(1)
        self._reader = SensedReader(self._sensed)
        self._asked = Tick(-1, 0, -1, (b"", b"", b""), b"", [])
        self._command, self._slot = (0.0, 0.0), 0
        self._frame: bytes | None = None
        self._status: AgentStatus | None = None

    @property
    def tick(self) -> int:
        """The last that was begun."""
        return self._asked.tick

    def take(self, asked: Tick) -> None:
        """Begin the tick for which this was sent."""
        self._asked, self._frame = asked, None

    def reply(self) -> Reply:
        """What the drone has done since."""
        asked = self._asked
        return Reply(
            self._process, asked.tick, asked.proof, *self._command, self._slot, self._frame, self._status
        )

    def farewell(self, status: AgentStatus) -> Farewell:
        """The drone's last word."""
        return Farewell(self._process, status)

    def sense(self) -> Sensed:
        self._reader.read(self._asked.sensed)
        return self._sensed

    def fly(self, ax: float, ay: float) -> None:
        self._command = ax, ay

    def hear(self) -> Heard:
        return Heard(self._asked.sources, self._asked.heard)

    def say(self, frame: bytes) -> None:
        self._frame = frame

    def report(self, slot: int, status: AgentStatus | None) -> None:
        self._slot, self._status = slot, status


class WorldClock:
    """Clock (agent.ports) of a drone in a relayed world: a tick is when the world sends one.

    Attributes:
        world: the drone's body and radio. ending: why the flight is over for this process, once it is.
    """

    def __init__(self, link: Link, leaving: Callable[[], bool], silence_s: float) -> None:
        """``silence_s``: as agent.process.fly."""
        self._link, self._leaving, self._silence_s = link, leaving, silence_s
        self._process = secrets.randbelow(messages.MAX_PROCESS)
        self.world = RelayedWorld(self._process)
        self.ending: Ending | None = None
        self._welcomed = False
        self._silent = 0  # looks that brought nothing

    def join(self) -> Welcome | None:
        """Ask to take part until the world says what is flown; None when it is over before.

        Raises:
            LinkError: the world refuses this process.
        """
        self._say(Hello(messages.VERSION, self._process))
        while (message := self._next()) is not None:
            if isinstance(message, Welcome) and message.process == self._process:
                self._welcomed = True
                return message
        return None

    def ticks(self) -> Iterator[int]:
        """As the port has it, once the drone has joined.

        Raises:
            LinkError: the world refuses this process.
        """
        self._say(Ready(self._process))
        while (message := self._next()) is not None:
            if isinstance(message, Tick):
                if message.tick > self.world.tick:
                    self.world.take(message)
                    yield message.tick
                if message.tick == self.world.tick:  # where the answer was lost, the world asks again
                    self._say(self.world.reply())

    def leave(self, status: AgentStatus) -> None:
        """Answer the world's Bye, if that is why it is over."""
        if self.ending is Ending.OVER:
            self._say(self.world.farewell(status))

    def _say(self, message: FromDrone) -> None:
        self._link.send(messages.pack(message))

    def _next(self) -> FromWorld | None:
        """What the world says next that is not settled here; None when it is over."""
        while not self._leaving():
            data = self._link.receive(_LISTEN_S)
            if data is None:
                self._silent += 1
                if self._silent * _LISTEN_S >= self._silence_s:
                    self.ending = Ending.WORLD_SILENT
                    return None
                if not self._welcomed:
                    self._say(Hello(messages.VERSION, self._process))
                elif self._silent % _LOOKS == 0 and self._silent <= _MOST_LOOKS:
                    self._say(Ready(self._process))
                continue
            self._silent = 0
            try:
                message = messages.unpack_from_world(data)
            except MessageError:
                continue
            if isinstance(message, Tick):
                return message
            if isinstance(message, Bye):
                self.ending = Ending.OVER
                return None
            if isinstance(message, Refused) and message.process == self._process:
                raise LinkError(message.why)
            if not isinstance(message, Wait):
                return message
            if self._welcomed:
                self._say(Ready(self._process))
        self.ending = Ending.ASKED_TO_LEAVE
        return None
