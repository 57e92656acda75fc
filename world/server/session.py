"""The world as a process: WorldCore behind a Zenoh router, one tick after the other.

lockstep  sends tick k to every drone that answers, waits for all answers, moves on: as fast as the machine allows, and
          repeatable. It waits as long as it takes for a drone whose process is stopped, for others as world.server.patience says.
realtime  ticks on the wall clock; an answer that is late counts as a deadline miss, and the drone keeps its last command
          for a little, then coasts.

A drone that is lost without the mission's doing breaks the run: its process ended, or it has not answered for too long
(realtime: `_LATE_S`). In flight it is struck off, and the others fly on to the end. All patience is counted in the world's own
running time, so no pause of the machine, the world or the whole launch loses anybody. Whoever runs the flight hands in a
`Control`: the launcher's end of a pipe, or nobody.
"""

import sys
import time
from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from protocols.dynamics import TICK_S
from protocols.errors import BrokenError
from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.sensed import SensedPacker
from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore
from world.director import Director
from world.faults import Event
from world.outcome import Flown
from world.outlets.snapshot import snapshot
from world.server.patience import Patience
from world.server.peer import BACKLOG, Peer
from world.server.ports import STRUCK_OFF, Control, Link, Lost
from world.server.running_time import RunningTime

Clock = Literal["lockstep", "realtime"]
_LATE_S = 5.0  # for one answer in real time
_FAREWELL_S, _HASTY_FAREWELL_S = 5.0, 0.5
_SNAPSHOT_S = 0.125
_UNKNOWN = "the world does not know this process: it has been started anew"


class ServerError(BrokenError, RuntimeError):
    """The run broke; one line says why."""


class WorldServer:
    """Runs one flight over a link: the swarm of `world.director.Director` whose drones are processes."""

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
        self._join_s = join_s
        self.core = WorldCore([mission])
        self.director = Director(self.core, self)
        agents = mission.agents
        self.peers = [Peer() for _ in range(agents)]
        self._mission_fields = mission.model_dump(mode="json")
        self._initial_slots = bytes(self.core.initial_slots[0].astype(np.uint8))
        self._sensors = SensedPacker(self.core.sensed)
        self._frames: list[list[bytes]] = [[b""] * agents for _ in range(self.core.ring)]
        self._command, self._sent_bytes = np.zeros((agents, 2)), np.zeros(agents, np.int64)
        self._claim = self.core.claim[0].astype(np.int64)
        # The same numbers, to be filled one by one.
        self._command_of: memoryview[Any] = self._command.data
        self._sent_bytes_of, self._claim_of = self._sent_bytes.data, self._claim.data
        self._accounts: list[tuple[int, AgentStatus]] = []
        self._farewells: dict[int, AgentStatus] = {}
        self._refused: set[int] = set()
        self._now = 0  # the tick
        self._time, self._patience = RunningTime(), Patience(agents)
        self._look_at = self._started = self._first_tick_at = self._began = 0.0
        self._misses = 0
        self._told = self._told_bytes = self._heard_bytes = 0

    def run(self) -> Flown:
        """Gather the drones, fly to the end, say goodbye.

        Raises:
            ServerError: drones are missing at the start, or one was lost before it.
        """
        try:
            self._gather()
            return self._fly()
        except ServerError:
            self._say_bye()
            raise

    def _fly(self) -> Flown:
        core = self.core
        self._record(core)
        self._first_tick_at, self._began, shown = time.time(), time.perf_counter(), -np.inf
        self._started = self._time.now()
        while core.active[0]:
            self.director.tick()
            if core.tick[0] > self._now:  # else it was broken off before it was flown
                self._record(core)
            now = time.perf_counter() - self._began
            if now - shown > _SNAPSHOT_S or not core.active[0]:
                shown = now
                factor = core.tick[0] * TICK_S / now
                self._control.show(snapshot(core, self.director.statuses, factor, self._misses))
        return self.flown()

    def flown(self) -> Flown:
        """What came of the flight, or would if it were interrupted now."""
        wall_s, told = time.perf_counter() - self._began, max(self._told, 1)
        sizes = (self._heard_bytes / told, self._told_bytes / told)
        return self.director.flown(wall_s, self._first_tick_at, self._misses, sizes)

    def _gather(self) -> None:
        """Welcome the drones until all are ready."""
        deadline = self._time.now() + self._join_s
        while not all(peer.ready for peer in self.peers):
            self._receive(messages.WAIT_EVERY_S)
            now = self._time.now()
            if self._control.leaving():
                raise ServerError("asked to leave before all drones had arrived")
            if now > deadline:
                missing = [agent for agent, peer in enumerate(self.peers) if not peer.ready]
                raise ServerError(f"agents {missing} did not arrive within {self._join_s:g} s")
            if now >= self._look_at:
                self._look(now)

    # The port of the director.

    def strike(self, event: Event) -> None:
        """Do to the drones' processes what this fault says."""
        if event.fault.kind == "restart":
            for agent in event.agents:
                self.peers[agent].restart()
                self.peers[agent].asked = self.peers[
                    agent
                ].answered  # what it was asked before, nobody will answer
        self._control.apply(event.fault.kind, event.agents)

    def struck_off(self, row: int) -> None:
        """It is over for this drone: it is told so, and whoever runs its process ends it."""
        self._send(row, messages.Bye())
        self._control.apply(STRUCK_OFF, (row,))

    def ask(self, tick: int, inbox: Inbox) -> Answers | None:
        """What the drones answer to this tick; None if the world is asked to leave."""
        self._now = tick
        self._accounts.clear()
        self._sent_bytes[:] = 0
        self._check_lost()
        awake: list[int] = np.flatnonzero(self.core.rows_awake).tolist()
        if self._clock == "lockstep":
            if not self._await(awake, lambda peer: peer.ready):
                return None
            self._say_tick(tick, awake, inbox)
            if not self._await(awake, lambda peer: peer.answered >= tick):
                return None
        else:
            self._say_tick(tick, [agent for agent in awake if self.peers[agent].ready], inbox)
            if not self._keep_time(awake, tick):
                return None
        return Answers(self._command, self._sent_bytes, self._claim, sorted(self._accounts))

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """Say goodbye and take the last accounts."""
        answering = np.flatnonzero(self.core.flying[0] & self.core.responsive[0]).tolist()
        waiting = {agent for agent in answering if self.peers[agent].ready}
        self._say_bye()
        deadline = self._time.now() + (_HASTY_FAREWELL_S if self._control.leaving() else _FAREWELL_S)
        while waiting and self._time.now() < deadline:
            self._receive(messages.WAIT_EVERY_S)
            waiting.difference_update(self._farewells, (lost.agent for lost in self._control.lost()))
        return sorted(self._farewells.items())

    # What the world says.

    def _send(self, agent: int, message: messages.FromWorld) -> None:
        self._link.send(agent, messages.pack(message))

    def _say_bye(self) -> None:
        for agent in range(self._mission.agents):
            self._send(agent, messages.Bye())

    def _say_tick(self, tick: int, awake: list[int], inbox: Inbox) -> None:
        ring, frames, now = self.core.ring, self._frames, self._time.now()
        bounds, sources = inbox.start.tolist(), inbox.arrived[:, 0].astype(np.uint8).tobytes()
        payloads = [frames[sent % ring][source] for source, sent in inbox.arrived.tolist()]
        for agent in awake:
            peer = self.peers[agent]
            if peer.backlogged:
                continue
            first, end = bounds[agent], bounds[agent + 1]
            message = messages.pack(
                messages.Tick(
                    tick, peer.answered, self._sensors.pack(agent), sources[first:end], payloads[first:end]
                )
            )
            peer.ask(tick, message, now)
            self._told += 1
            self._told_bytes += len(message)
            self._link.send(agent, message)

    # Waiting.

    def _await(self, awake: list[int], done: Callable[[Peer], bool]) -> bool:
        """Receive until every awake drone is done; False when the world is asked to leave instead."""
        waiting = {agent for agent in awake if not done(self.peers[agent])}
        self._patience.begin(waiting, len(awake) > 1, self._time.now())
        while waiting:
            heard, now = self._receive(messages.WAIT_EVERY_S), self._time.now()
            if heard is not None and heard in waiting and done(self.peers[heard]):
                waiting.discard(heard)
                if len(waiting) < 2:
                    self._patience.left(waiting, now)
            if now >= self._look_at:
                self._look(now)
                waiting = self._look_at_late(waiting, now)
            if self._control.leaving():
                return False
        return True

    def _look_at_late(self, waiting: set[int], now: float) -> set[int]:
        """Lose those for whom patience is over; who of ``waiting`` is still awaited."""
        for agent in waiting:
            if self._patience.is_odd(agent, now) and self._control.paused(agent):
                self._patience.pause(agent, now)
            elif why := self._patience.over(agent, now, now - self._started):
                self._lose(Lost(agent, why))
        left = {agent for agent in waiting if self.core.flying[0, agent]}
        if left != waiting and len(left) < 2:
            self._patience.left(left, now)
        return left

    def _keep_time(self, awake: list[int], tick: int) -> bool:
        """Receive until the clock says that the tick is over, and count who has not answered it; as `_await`."""
        deadline = self._started + (tick + 1) * TICK_S
        while (left := deadline - self._time.now()) > 0:
            self._receive(left)
        for _ in awake:  # what came in the meantime, but no flood
            self._receive(0)
        if (now := self._time.now()) >= self._look_at:
            self._look(now)
        for agent in awake:
            behind = tick - self.peers[agent].answered
            self._misses += behind > 0
            if behind > BACKLOG:
                self._command[agent] = 0.0
            if behind * TICK_S > _LATE_S and not self._control.paused(agent):
                self._lose(Lost(agent, f"it has not answered for {_LATE_S:g} s"))
        return not self._control.leaving()

    def _look(self, now_s: float) -> None:
        """Every now and then, however much is said meanwhile: is everybody there, and does everybody know that the world is."""
        self._look_at = now_s + messages.WAIT_EVERY_S
        self._check_lost()
        for agent in np.flatnonzero(self.core.flying[0]).tolist():
            if self.peers[agent].wait(now_s):
                self._send(agent, messages.Wait())

    def _check_lost(self) -> None:
        lost = [lost for lost in self._control.lost() if self.core.flying[0, lost.agent]]
        if lost:
            self._lose(*lost)

    def _lose(self, *lost: Lost) -> None:
        """Drones were lost without the mission's doing.

        Raises:
            ServerError: the flight has not begun.
        """
        if not self._started:
            raise ServerError(
                "; ".join(f"agent {agent} was lost before the flight began: {why}" for agent, why in lost)
            )
        for agent, why in lost:
            self.director.strike_off(agent, why)

    # What the drones say.

    def _receive(self, timeout_s: float) -> int | None:
        """Take in one message; return its sender, or None if none came in time or it was none of a drone of this flight."""
        received = self._link.receive(timeout_s)
        if received is None:
            return None
        agent, data = received
        try:
            message = messages.unpack_from_drone(data, self._mission.agents)
        except messages.MessageError:
            return None
        peer = self.peers[agent]
        if isinstance(message, messages.Hello):
            self._greet(agent, peer, message)
            return agent
        if message.process != peer.process:
            if peer.process is not None:
                self._refuse(agent, message.process)
            else:
                self._send(agent, messages.Refused(message.process, _UNKNOWN))
            return None
        rival = peer.heard()
        if rival is not None:
            self._refuse(agent, rival)
        if isinstance(message, messages.Reply):
            self._heard_bytes += len(data)
            self._take_reply(agent, peer, message)
        elif isinstance(message, messages.Ready):
            self._take_ready(agent, peer)
        elif isinstance(message, messages.Farewell):
            self._farewells[agent] = message.status
        return agent

    def _greet(self, agent: int, peer: Peer, hello: messages.Hello) -> None:
        if hello.version != messages.VERSION:
            wrong = (
                f"agent {agent} speaks version {hello.version} of the messages, the world {messages.VERSION}"
            )
            self._send(agent, messages.Refused(hello.process, wrong))
            if not self._started:
                raise ServerError(wrong)  # no single drone ends a flight that has begun
        elif not self.core.flying[0, agent]:
            self._send(agent, messages.Bye())
        elif peer.knock(hello.process, self._time.now(), self._control.paused(agent)) and not peer.ready:
            if peer.boot:
                self.director.invariants[0].renew(agent)
            self._send(
                agent, messages.Welcome(hello.process, self._mission_fields, self._initial_slots, peer.boot)
            )

    def _refuse(self, agent: int, process: int) -> None:
        why = (
            f"another process flies as agent {agent} already: end it first, or use the login of another agent"
        )
        self._send(agent, messages.Refused(process, why))
        if process not in self._refused and len(self._refused) < self._mission.agents:
            self._refused.add(process)
            print(f"world: a second process with the login of agent {agent} was refused", file=sys.stderr)

    def _take_ready(self, agent: int, peer: Peer) -> None:
        """This drone is there, and has read what it was sent: a Tick that it has not answered was lost, or its answer was. In
        lockstep it is asked again; in real time the next one will do.
        """
        peer.ready = True
        if self._clock == "realtime":
            peer.asked = peer.answered
        elif peer.ask_again(self._time.now()):
            self._link.send(agent, peer.question)

    def _take_reply(self, agent: int, peer: Peer, reply: messages.Reply) -> None:
        if not peer.answered < reply.tick <= peer.asked:
            return
        peer.answered = reply.tick
        self._command_of[agent, 0], self._command_of[agent, 1] = reply.ax, reply.ay
        self._claim_of[agent] = reply.slot
        if reply.status is not None:
            self._accounts.append((agent, reply.status))
        if reply.frame is not None:
            self._frames[self._now % self.core.ring][agent] = reply.frame
            self._sent_bytes_of[agent] = len(reply.frame)
