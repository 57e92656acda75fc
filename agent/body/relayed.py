"""A drone whose nature is a server: each Tick brings all that reaches it, each Reply takes all that it does.

`RelayedWorld` is its body and its radio, without input and output; `WorldClock`, over a link, is its clock: it takes part in the
flight until the world says Bye, until the world has been silent for too long, or until the process is asked to leave.
"""

import secrets
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import Protocol

import numpy as np

from agent.body.foresight import Commands, Foresight
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
from protocols.wire.sensed import SensedReader, empty_sensed
from protocols.wire.status import AgentStatus

_LISTEN_S = 0.2
_ROOM = 32_768  # bytes of a message, at first
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

    def use_datagrams(self, key: bytes) -> None: ...

    def cast(self, payload: bytes) -> bool: ...


_NOTHING = Tick(-1, 0, -1, 0, 0, 0, b"")


class RelayedWorld:
    """Body and radio (agent.ports) of the drone that is flown by process number ``process``.

    Attributes:
        tick: the last that was begun. heard: what is heard, and the rest of its Tick.
    """

    def __init__(self, process: int) -> None:
        self.process = process
        self.sensed = empty_sensed(1)
        self._reader = SensedReader(self.sensed)
        self._make_room(_ROOM)
        self._asked, self.tick = _NOTHING, -1
        self._answer: bytes | None = None
        self._begun = True
        self._command, self._slot = (0.0, 0.0), 0
        self._frame: bytes | None = None
        self._status: AgentStatus | None = None
        self._plan = b""
        self._told = -1  # the tick of the first reply that told it
        self._foresight = Foresight()

    def _make_room(self, size: int) -> None:
        self.heard = np.zeros(size, np.uint8)
        self._into = self.heard.data

    def take(self, asked: Tick) -> None:
        """Begin the tick for which this was sent; frames of one that it overtakes are heard with its own."""
        if not self._begun:
            missed = self._asked
            asked = asked._replace(
                heard=missed.heard + asked.heard,
                data=asked.data[: asked.heard_at]
                + missed.data[missed.heard_at :]
                + asked.data[asked.heard_at :],
            )
        self._asked, self._frame, self._plan, self._begun = asked, None, b"", False
        self.tick, self._answer = asked.tick, None
        if asked.followed >= self._told:
            self._status = None

    @property
    def commands(self) -> Commands:
        """The last ones; whoever answers Ticks in this world's stead writes them there."""
        return self._foresight.commands

    def answered(self, tick: int, reply: bytes, status: AgentStatus | None) -> None:
        """This tick was answered in this world's stead, in time: so the last answer has come, whatever account it gave.
        ``status``: the one that this answer gives."""
        self.tick, self._answer, self._status = tick, reply, status
        if status is not None:
            self._told = tick

    def reply(self) -> bytes:
        """What the drone has done since the tick began, packed; the same again until the next one."""
        asked = self._asked
        if self._answer is None:
            does = *self._command, self._slot, self._frame, self._status, self._plan
            self._answer = messages.pack(Reply(self.process, asked.tick, asked.proof, *does))
        return self._answer

    def farewell(self, status: AgentStatus) -> Farewell:
        """The drone's last word."""
        return Farewell(self.process, status)

    def sense(self) -> None:
        asked = self._asked
        self._reader.read(asked.data, messages.TICK_HEAD.size, asked.near, asked.obstacles)
        self._foresight.move_on(asked.tick, asked.followed, self.sensed)
        self._begun = True

    def fly(self, ax: float, ay: float) -> None:
        self._command = ax, ay
        self._foresight.remember(self._asked.tick, ax, ay)

    def hear(self) -> Heard:
        asked = self._asked
        if asked.heard:
            size = len(asked.data)
            if size > len(self.heard):
                self._make_room(2 * size)
            self._into[:size] = asked.data
            return Heard(self.heard, asked.heard_at, size, asked.heard)
        return Heard(self.heard, 0, 0, 0)

    def say(self, frame: bytes) -> None:
        self._frame = frame

    def report(self, slot: int, status: AgentStatus | None) -> None:
        self._slot = slot
        if status is not None:  # it is told again until the world follows an answer that told it
            self._status, self._told = status, self._asked.tick

    def tell_plan(self, plan: bytes) -> None:
        """Tell those who look on what was planned at this tick, packed; nothing, if that is empty."""
        self._plan = plan


class WorldClock:
    """Clock (agent.ports) of a drone in a relayed world: a tick is when the world sends one.

    Attributes:
        world: the drone's body and radio. ending: why the flight is over for this process, once it is. quick: answers a Tick at
        once, with the Reply, or with None where the drone is to act.
    """

    def __init__(self, link: Link, leaving: Callable[[], bool], silence_s: float) -> None:
        """``silence_s``: as agent.process.fly."""
        self._link, self._leaving, self._silence_s = link, leaving, silence_s
        self._process = secrets.randbelow(messages.MAX_PROCESS)
        self.world = RelayedWorld(self._process)
        self.ending: Ending | None = None
        self.quick: Callable[[bytes], bytes | None] = lambda message: None
        self._send_soon: Callable[[bytes], None] = link.send
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
                if message.datagram_key:
                    self._link.use_datagrams(message.datagram_key)
                    self._send_soon = self._cast_or_send
                return message
        return None

    def ticks(self) -> Iterator[int]:
        """As the port has it, once the drone has joined.

        Raises:
            LinkError: the world refuses this process.
        """
        self._say_both_ways(Ready(self._process))
        while self._wait_for_tick():
            yield self.world.tick
            self._send_soon(self.world.reply())

    def _wait_for_tick(self) -> bool:
        """Wait for a tick that is new, and begin the newest there is; False when the flight is over."""
        fresh = False
        while (message := self._next(0.0 if fresh else _LISTEN_S)) is not None:
            if isinstance(message, Tick):
                if message.tick > self.world.tick:
                    self.world.take(message)
                    fresh = True
                elif (
                    message.tick == self.world.tick and not fresh
                ):  # its answer was lost, so the world asks again
                    self._send_soon(self.world.reply())
        return fresh and self.ending is None

    def leave(self, status: AgentStatus) -> None:
        """Answer the world's Bye, if that is why it is over."""
        if self.ending is Ending.OVER:
            self._say_both_ways(self.world.farewell(status))

    def _say(self, message: FromDrone) -> None:
        self._link.send(messages.pack(message))

    def _cast_or_send(self, data: bytes) -> None:
        """In real time what waits for what was lost before it is worth nothing; but a way that is not open is none."""
        if not self._link.cast(data):
            self._link.send(data)

    def _say_both_ways(self, message: FromDrone) -> None:
        data = messages.pack(message)
        self._link.cast(data)
        self._link.send(data)

    def _next(self, wait_s: float = _LISTEN_S) -> FromWorld | None:
        """What the world says next that is not settled here; None when it is over, or, without a wait, when nothing is there."""
        while not self._leaving():
            data = self._link.receive(wait_s)
            if data is None and not wait_s:
                return None
            if data is None:
                self._silent += 1
                if self._silent * _LISTEN_S >= self._silence_s:
                    self.ending = Ending.WORLD_SILENT
                    return None
                if not self._welcomed:
                    self._say(Hello(messages.VERSION, self._process))
                elif self._silent % _LOOKS == 0 and self._silent <= _MOST_LOOKS:
                    self._say_both_ways(Ready(self._process))
                continue
            self._silent = 0
            if (reply := self.quick(data)) is not None:
                self._send_soon(reply)
                continue
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
