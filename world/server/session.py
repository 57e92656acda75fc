"""The world as a process: WorldCore behind a Zenoh router, one tick after the other.

lockstep  sends tick k to every drone that answers, waits for all answers, moves on: as fast as the machine allows, and
          repeatable.
realtime  ticks on the wall clock; an answer that is late counts as a deadline miss, and the drone keeps its last command
          for a little, then coasts.

A drone that has not answered for `_ANSWER_S` is lost. One whose process comes back before that is welcomed as restarted.

Whoever runs the flight hands in a `Control`: the launcher's end of a pipe, or nothing at all.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import Any, Literal, Protocol

import numpy as np

from protocols.dynamics import ABSURD_MPS2, TICK_S
from protocols.errors import BrokenError
from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.sensed import SensedPacker
from protocols.wire.status import AgentStatus, parse_status
from world.core import Outcome, WorldCore
from world.invariants import Watch, Watched
from world.medium.medium import TALLY
from world.outlets.snapshot import Snapshot, snapshot

Clock = Literal["lockstep", "realtime"]
_ANSWER_S = 5.0  # patience for one answer
# Unanswered ticks after which a drone is sent no more until it answers: a full pipe would block the world.
_BACKLOG = 20
_SNAPSHOT_S = 0.125
_SIZE_SAMPLE = 20_000


class ServerError(BrokenError, RuntimeError):
    """The flight could not be run; one line says why."""


class Link(Protocol):
    """Bytes to and from drones: world.server.link.WorldLink, or a test's."""

    def send(self, agent: int, payload: bytes) -> None: ...

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None: ...


class Control(Protocol):
    """What the world asks of, and hears from, whoever runs the processes."""

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        """Do this to the drones' processes: kill, freeze, thaw or restart."""

    def lost(self) -> list[int]:
        """Drones whose processes have ended since the last call."""

    def show(self, picture: Snapshot) -> None:
        """Show the flight."""

    def leaving(self) -> bool:
        """Whether to end the flight now."""


class NoControl:
    """Nobody runs the processes: each drone is on a machine of its own."""

    def __init__(self, leaving: Callable[[], bool], show: Callable[[Snapshot], None]) -> None:
        self.leaving = leaving
        self.show = show

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        """A fault of a process cannot be made from here; the drone is only treated as if it had happened."""

    def lost(self) -> list[int]:
        """Unknown from here."""
        return []


@dataclass(frozen=True)
class Flown:
    """A flight and its figures. tally: per world.medium.medium.TALLY. statuses: each drone's last account."""

    outcome: Outcome
    tally: dict[str, int]
    statuses: dict[int, AgentStatus]
    watched: Watched
    wall_s: float
    real_time_factor: float
    deadline_misses: int
    median_frame_bytes: float
    message_bytes: tuple[float, float]  # mean size of a drone's REPLY and of the world's TICK
    first_tick_at: float  # time.time()


class WorldServer:
    """Runs one flight over a link."""

    def __init__(
        self,
        mission: Mission,
        link: Link,
        clock: Clock,
        control: Control,
        record: Callable[[WorldCore], None] | None = None,
        join_s: float = 30.0,
    ) -> None:
        """``record`` is called before the first tick and after every tick; ``join_s`` is the patience for drones to arrive.

        Raises:
            world.field.FieldError: the mission leaves no room to start.
        """
        self._mission, self._link, self._clock, self._control = mission, link, clock, control
        self._record = record or (lambda core: None)
        self.core = WorldCore([mission])
        agents = mission.agents
        self._join_s = join_s
        self._welcome_fields = mission.model_dump(mode="json")
        self._boots = [0] * agents
        self._ready = [False] * agents
        self._frames: list[list[bytes]] = [[b""] * agents for _ in range(self.core.ring)]
        self._sensors = SensedPacker(self.core.sensed)
        self._now = 0  # the tick
        self._command, self._sent_bytes = np.zeros((agents, 2)), np.zeros(agents, np.int64)
        self._claim = self.core.claim[0].astype(np.int64)
        # The same numbers, to be filled one by one.
        self._command_of = self._command.data
        self._sent_bytes_of, self._claim_of = self._sent_bytes.data, self._claim.data
        self._statuses: dict[int, AgentStatus] = {}
        self._watch = Watch(agents, mission.swap.cooldown_s)
        self._sizes: list[int] = []
        self._misses = 0
        self._told = self._told_bytes = self._heard_bytes = 0
        self._pulsed = 0.0
        self._answered = [-1] * agents  # the last tick each drone answered
        self._asked = [-1] * agents  # and the last it was sent, and in which words
        self._question = [b""] * agents

    def run(self) -> Flown:
        """Gather the drones, fly to the end, say goodbye.

        Raises:
            ServerError: drones are missing at the start, or all left.
        """
        self._gather()
        self._record(self.core)
        first_tick_at, started, shown = time.time(), time.perf_counter(), 0.0
        core = self.core
        while core.active[0]:
            self._tick(started)
            self._record(core)
            now = time.perf_counter() - started
            if now - shown > _SNAPSHOT_S or not core.active[0]:
                shown = now
                factor = core.tick[0] * TICK_S / now
                self._control.show(snapshot(core, self._statuses, factor, self._misses))
        wall = time.perf_counter() - started
        self._dismiss()
        told = max(self._told, 1)
        outcome = core.outcomes[0]
        assert outcome is not None
        return Flown(
            outcome=outcome,
            tally=dict(zip(TALLY, (int(number) for number in core.tally[0]), strict=True)),
            statuses=self._statuses,
            watched=self._watch.result(),
            wall_s=wall,
            real_time_factor=outcome.ticks * TICK_S / wall,
            deadline_misses=self._misses,
            median_frame_bytes=float(median(self._sizes)) if self._sizes else 0.0,
            message_bytes=(self._heard_bytes / told, self._told_bytes / told),
            first_tick_at=first_tick_at,
        )

    def _gather(self) -> None:
        """Welcome the drones until all are ready."""
        deadline = time.monotonic() + self._join_s
        while not all(self._ready):
            missing = [agent for agent, ready in enumerate(self._ready) if not ready]
            if self._control.leaving():
                raise ServerError("asked to leave before all drones had arrived")
            gone = self._control.lost()
            if gone:
                raise ServerError(f"the process of agent {gone[0]} ended before the flight began")
            if time.monotonic() > deadline:
                raise ServerError(f"agents {missing} did not arrive within {self._join_s:g} s")
            self._receive(messages.WAIT_EVERY_S)
            self._pulse()

    def _dismiss(self) -> None:
        """Say goodbye and take the last accounts."""
        answering = self.core.flying[0] & self.core.responsive[0]
        waiting = {agent for agent in np.flatnonzero(answering).tolist() if self._ready[agent]}
        for agent in range(self._mission.agents):
            self._link.send(agent, messages.pack(messages.BYE))
        deadline = time.monotonic() + 0.5
        self._answered = [-1] * self._mission.agents
        while waiting and time.monotonic() < deadline:
            heard = self._receive(0.1)
            if heard is not None and self._answered[heard] >= 0:
                waiting.discard(heard)

    def _tick(self, started: float) -> None:
        core, tick = self.core, self._now
        for event in core.begin_tick():
            self._watch.fault(tick)
            if event.fault.kind == "restart":
                for agent in event.agents:
                    self._boots[agent] += 1
                    self._ready[agent] = False
                    self._asked[agent] = self._answered[agent]
            self._control.apply(event.fault.kind, event.agents)
        self._lose(self._control.lost())
        awake = self._awake()
        if self._clock == "lockstep":
            awake = self._await(awake, lambda agent: self._ready[agent])
        self._sent_bytes[:] = 0
        self._say_tick(tick, [agent for agent in awake if self._ready[agent]])
        if self._clock == "lockstep":
            awake = self._await(awake, lambda agent: self._answered[agent] >= tick)
        else:
            awake = self._keep_time(tick, started + (tick + 1) * TICK_S)
        self._watch.tick(tick, awake, core.could_know(0))
        core.advance(self._command, self._sent_bytes, self._claim)
        self._now = int(core.tick[0])
        if core.active[0] and self._watch.breach:
            core.end(0, "broken-invariant")
        elif core.active[0] and self._control.leaving():
            core.end(0, "interrupted")
        elif core.active[0] and not core.flying[0].any():
            core.end(0, "all-lost")

    def _awake(self) -> list[int]:
        return np.flatnonzero(self.core.rows_awake).tolist()

    def _say_tick(self, tick: int, awake: list[int]) -> None:
        self.core.sense()
        start, arrived = self.core.deliver()
        ring, frames = self.core.ring, self._frames
        bounds, sources = start.tolist(), arrived[:, 0].astype(np.uint8).tobytes()
        payloads = [frames[sent % ring][source] for source, sent in arrived.tolist()]
        for agent in awake:
            if self._asked[agent] - self._answered[agent] > _BACKLOG:
                continue
            self._asked[agent] = tick
            first, end = bounds[agent], bounds[agent + 1]
            message = messages.pack(
                messages.TICK, tick, self._sensors.pack(agent), sources[first:end], payloads[first:end]
            )
            self._question[agent] = message
            self._told += 1
            self._told_bytes += len(message)
            self._link.send(agent, message)

    def _await(self, awake: list[int], done: Callable[[int], bool]) -> list[int]:
        """Receive until every awake drone is done; return who is awake then.

        The drones are told meanwhile that the world is alive.
        """
        waiting = {agent for agent in awake if not done(agent)}
        deadline = time.monotonic() + _ANSWER_S
        while waiting:
            heard = self._receive(messages.WAIT_EVERY_S)
            if heard is not None and done(heard):
                waiting.discard(heard)
            elif heard is None:
                self._pulse()
                self._lose(self._control.lost())
                awake = self._awake()
                waiting.intersection_update(awake)
            if self._control.leaving():
                break
            if time.monotonic() > deadline:
                self._lose(list(waiting))
                return self._awake()
        return awake

    def _pulse(self) -> None:
        """Tell all drones, now and then, that the world is alive."""
        if time.monotonic() - self._pulsed >= messages.WAIT_EVERY_S:
            self._pulsed = time.monotonic()
            for agent in self._awake():
                self._link.send(agent, messages.pack(messages.WAIT))

    def _keep_time(self, tick: int, deadline: float) -> list[int]:
        """Receive until the wall clock says that the tick is over; count who has not answered it, return who is awake."""
        while (left := deadline - time.perf_counter()) > 0:
            self._receive(left)
        awake = self._awake()
        for _ in awake:  # what came in the meantime, but no information_bound
            self._receive(0)
        for agent in awake:
            behind = tick - self._answered[agent]
            self._misses += behind > 0
            if behind > _BACKLOG:
                self._command[agent] = 0.0
            if behind * TICK_S > _ANSWER_S:
                self._lose([agent])
        return self._awake()

    def _lose(self, agents: list[int]) -> None:
        gone = [agent for agent in agents if self.core.flying[0, agent]]
        if gone:
            self._watch.fault(self._now)
            self.core.lose(0, gone)

    def _receive(self, timeout_s: float) -> int | None:
        """Take in one message; return its sender, or None if none came in time or it was no message of ours."""
        received = self._link.receive(timeout_s)
        if received is None:
            return None
        agent, data = received
        try:
            kind, fields = messages.unpack(data)
            if kind == messages.REPLY:
                self._heard_bytes += len(data)
                self._take_reply(agent, *fields)
            elif kind == messages.HELLO:
                self._greet(agent, fields[0])
            elif kind == messages.READY:
                self._take_ready(agent)
        except (messages.MessageError, ValueError, TypeError, IndexError):
            return None
        return agent

    def _greet(self, agent: int, version: Any) -> None:
        if version != messages.VERSION:
            wrong = f"agent {agent} speaks version {version} of the messages, the world {messages.VERSION}"
            if self._now == 0 and not self._ready[agent]:
                raise ServerError(wrong)
            raise ValueError(wrong)  # no single drone ends a flight that has begun
        if not self.core.flying[0, agent]:
            self._link.send(agent, messages.pack(messages.BYE))
            return
        if self._ready[agent]:  # a HELLO after its READY is another process: it knows nothing
            self._boots[agent] += 1
            self._ready[agent] = False
        slots = bytes(self.core.initial_slots[0].astype(np.uint8))
        self._link.send(
            agent, messages.pack(messages.WELCOME, self._welcome_fields, slots, self._boots[agent])
        )

    def _take_ready(self, agent: int) -> None:
        """From now on this drone is sent every tick; in lockstep also the one it missed while it was away."""
        self._ready[agent] = True
        missed = self._asked[agent] > self._answered[agent]
        if missed and self._clock == "lockstep":
            self._link.send(agent, self._question[agent])
        elif missed:
            self._asked[agent] = self._answered[agent]

    def _take_reply(
        self, agent: int, tick: Any, ax: Any, ay: Any, slot: Any, frame: Any, status: Any
    ) -> None:
        """A drone's command, frame and account.

        Raises:
            ValueError, TypeError: not what a drone may say; nothing of it is used.
        """
        if not (abs(ax) <= ABSURD_MPS2 and abs(ay) <= ABSURD_MPS2):
            raise ValueError("not a command")
        if type(slot) is not int or not 0 <= slot < self._mission.agents:
            raise ValueError("not a slot")
        if type(tick) is not int or not -1 <= tick <= self._now:
            raise ValueError("an answer to a tick that has not been")
        if frame is not None and type(frame) is not bytes:
            raise ValueError("a frame is bytes")
        if status is not None:
            account = parse_status(status, self._mission.agents)
            self._statuses[agent] = account
            self._watch.see(self._now, agent, account)
        if tick <= self._answered[agent]:
            return
        self._answered[agent] = tick
        self._command_of[agent, 0], self._command_of[agent, 1] = ax, ay
        self._claim_of[agent] = slot
        if frame is not None:
            self._frames[self._now % self.core.ring][agent] = frame
            self._sent_bytes_of[agent] = len(frame)
            if len(self._sizes) < _SIZE_SAMPLE:
                self._sizes.append(len(frame))
