"""The world as a process: WorldCore behind a Zenoh router, one tick after the other.

lockstep  sends tick k to every drone that answers, waits for all answers, moves on: as fast as the machine allows, and
          repeatable. It waits as long as it takes for a drone whose process is stopped, for others as world.server.patience says.
realtime  ticks on the wall clock; an answer that is late counts as a deadline miss, and the drone keeps its last command
          for a little, then its failsafe brakes it (world.failsafe).

A drone that is lost without the mission's doing breaks the run: its process ended, or it has not answered for too long. In flight
it is struck off, and the others fly on to the end. All patience is counted in the world's own running time, so no pause of the
machine, the world or the whole launch loses anybody. Whoever runs the flight hands in a `Control`: a launcher, or nobody.
"""

import time
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.status import AgentStatus
from world.core import Answers, Inbox, WorldCore
from world.director import Director, Swarm
from world.failsafe import Failsafe
from world.faults import Event
from world.outcome import Flown
from world.outlets.onlooker import Nobody, Onlooker
from world.outlets.snapshot import snapshot
from world.server.patience import Patience
from world.server.peer import FLOODS, Peer
from world.server.ports import STRUCK_OFF, Control, Link, Lost, ServerError
from world.server.questions import Questions
from world.server.reception import Reception
from world.server.running_time import RunningTime
from world.server.said import Said

Clock = Literal["lockstep", "realtime"]
_FAREWELL_S, _HASTY_FAREWELL_S = 5.0, 0.5
_SNAPSHOT_S = 0.125
_MOST_A_TICK = 4096  # messages that are read at the end of a tick in real time


class WorldServer(Swarm):
    """Runs one flight over a link: the swarm of `world.director.Director` whose drones are processes."""

    def __init__(
        self,
        mission: Mission,
        link: Link,
        clock: Clock,
        control: Control,
        record: Callable[[WorldCore], None] | None = None,
        join_s: float = 30.0,
        onlooker: Onlooker | None = None,
    ) -> None:
        """``record`` is called before the first tick and after every tick; ``join_s`` is the patience for drones to arrive.

        Raises:
            world.field.FieldError: the mission leaves no room to start.
        """
        self._mission, self._link, self._clock, self._control = mission, link, clock, control
        self._record, self._join_s = record or (lambda core: None), join_s
        self._onlooker = onlooker or Nobody()
        self.core = WorldCore([mission], watched=onlooker is not None)
        self.director = Director(self.core, self)
        self.peers = [Peer() for _ in range(mission.agents)]
        slots = bytes(self.core.initial_slots[0].astype(np.uint8))
        self._reception = Reception(link, self.peers, mission.briefing(), slots, onlooker is not None)
        self._said = Said(self.core)
        self._questions = Questions(self.core, self._said.frames)
        self._farewells: dict[int, AgentStatus] = {}
        self._now = self._proof = 0  # the tick, and its proof
        self._time, self._patience = RunningTime(), Patience(mission.agents, control.watches)
        self._look_at = self._started = self._first_tick_at = self._began = 0.0
        self._failsafe, self._took_s = Failsafe(mission), 0.0  # wall clock, until the flight was decided
        self._told = self._told_bytes = self._heard_bytes = 0

    def run(self) -> Flown:
        """Gather the drones, fly to the end, say goodbye.

        Raises:
            ServerError: drones are missing at the start, one was lost before it, or nothing was flown.
        """
        try:
            self._gather()
            return self._fly()
        except ServerError:
            self._reception.say_bye()
            raise

    def _fly(self) -> Flown:
        core = self.core
        self._record(core)
        self._first_tick_at, self._began, shown = time.time(), time.perf_counter(), -np.inf
        self._started = self._time.now()
        while core.active[0]:
            self._look_on()
            self.director.tick()
            if core.tick[0] == 0:
                raise ServerError("asked to leave before the first tick")
            if core.tick[0] > self._now:  # else it was broken off before it was flown
                self._record(core)
            now = time.perf_counter() - self._began
            if not self._took_s and core.decided[0]:
                self._took_s = now
            if now - shown > _SNAPSHOT_S or not core.active[0]:
                shown = now
                factor = core.tick[0] * TICK_S / now
                self._control.show(snapshot(core, self.director.statuses, factor, self._failsafe.misses))
        self._onlooker.attend(self.director)
        return self.flown()

    def _look_on(self) -> None:
        """Let the onlooker look, and wait as long as it wants: such waiting is no time of the flight."""
        while (wait_s := self._onlooker.attend(self.director)) > 0 and not self._control.leaving():
            self._receive_until(self._time.now() + wait_s)
            self._started += wait_s
            self._began += wait_s

    def flown(self) -> Flown:
        """What came of the flight, or would if it were interrupted now."""
        told, wall_s = max(self._told, 1), self._took_s or time.perf_counter() - self._began
        sizes = (self._heard_bytes / told, self._told_bytes / told)
        ages = self._failsafe.ages() if self._clock == "realtime" else None
        return self.director.flown(wall_s, self._first_tick_at, sizes, command_ages=ages)

    def _gather(self) -> None:
        """Welcome the drones until all are ready."""
        deadline, told = self._time.now() + self._join_s, -1
        while (ready := sum(peer.ready for peer in self.peers)) < len(self.peers):
            if ready != told:
                self._control.gathered(ready)
                told = ready
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
        for agent in event.agents if event.fault.kind == "restart" else ():
            self.peers[agent].restart()
            self._said.plans.forget(agent)
        self._control.apply(event.fault.kind, event.agents)

    def struck_off(self, row: int) -> None:
        """It is over for this drone: it is told so, and whoever runs its process ends it."""
        self._reception.send(row, messages.Bye())
        self._link.bar(row)
        self._control.apply(STRUCK_OFF, (row,))

    def ask(self, tick: int, inbox: Inbox) -> Answers | None:
        """What the drones answer to this tick; None if the world is asked to leave."""
        self._now, self._proof = tick, self._said.begin(tick)
        self._check_lost()
        awake: list[int] = np.flatnonzero(self.core.rows_awake).tolist()
        if self._clock == "lockstep":
            if not self._await(awake, lambda peer: peer.ready):
                return None
            self._say_tick(tick, awake)
            if not self._await(awake, lambda peer: peer.answered >= tick):
                return None
        else:
            self._say_tick(tick, [agent for agent in awake if self.peers[agent].ready])
            if not self._keep_time(awake, tick):
                return None
        return self._said.answers()

    def farewell(self) -> list[tuple[int, AgentStatus]]:
        """Say goodbye and take the last accounts."""
        answering = np.flatnonzero(self.core.flying[0] & self.core.responsive[0]).tolist()
        waiting = {agent for agent in answering if self.peers[agent].ready}
        self._reception.say_bye()
        deadline = self._time.now() + (_HASTY_FAREWELL_S if self._control.leaving() else _FAREWELL_S)
        while waiting and self._time.now() < deadline:
            self._receive(messages.WAIT_EVERY_S)
            waiting.difference_update(self._farewells, (lost.agent for lost in self._control.lost()))
        return sorted(self._farewells.items())

    def plans(self, world: int) -> NDArray[np.float32] | None:
        """As far as drones have told: they do where somebody looks on."""
        return self._said.plans.ahead(self.director.clock)

    # What the world says.

    def _say_tick(self, tick: int, awake: list[int]) -> None:
        now, proof, peers = self._time.now(), self._proof, self.peers
        written = self._questions.write(tick, proof, awake, [peer.answered for peer in peers])
        in_lockstep, send = self._clock == "lockstep", self._link.send
        for agent in awake:
            peer, message = peers[agent], written[agent]
            if piped := in_lockstep or not self._link.cast(agent, message):
                if peer.backlogged or not peer.room(len(message)):
                    continue
                send(agent, message)
            peer.ask(tick, proof, message, now, piped)
            self._told += 1
            self._told_bytes += len(message)

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
        return not self._control.leaving()

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
        """Receive until the clock says that the tick is over; who has not answered lately has its failsafe. As `_await`."""
        self._receive_until(self._started + (tick + 1) * TICK_S)
        for _ in range(_MOST_A_TICK):  # what came in the meantime, but no flood
            if (received := self._link.receive(0)) is None:
                break
            self._take(*received)
        answered = np.array([peer.answered for peer in self.peers])
        core, watch = self.core, self._failsafe
        for agent in watch.replace_old(tick, answered, core.rows_awake, core.velocity[0], self._said.command):
            core.land(0, agent)
            self.struck_off(agent)
        for agent, why in watch.silent:
            if self._control.paused(agent):
                watch.excuse(agent, tick)
            else:
                self._lose(Lost(agent, why))
        return not self._control.leaving()

    def _look(self, now_s: float) -> None:
        """Every now and then, however much is said meanwhile: is everybody there, and does everybody know that the world is."""
        self._look_at = now_s + messages.WAIT_EVERY_S
        self._check_lost()
        for agent in np.flatnonzero(self.core.flying[0]).tolist():
            peer = self.peers[agent]
            peer.turned_away(self._link.turned_away(agent), now_s)
            if peer.floods:
                self._lose(Lost(agent, FLOODS))
            elif peer.wait(now_s):
                self._reception.send(agent, messages.Wait())

    def _check_lost(self) -> None:
        if lost := [lost for lost in self._control.lost() if self.core.flying[0, lost.agent]]:
            self._lose(*lost)

    def _lose(self, *lost: Lost) -> None:
        """Drones were lost without the mission's doing.

        Raises:
            ServerError: the flight has not begun.
        """
        if not self._started:
            said = [f"agent {agent} was lost before the flight began: {why}" for agent, why in lost]
            raise ServerError("; ".join(said))
        for agent, why in lost:
            self.director.strike_off(agent, why)

    # What the drones say.

    def _receive_until(self, deadline: float) -> None:
        """Take in messages until then, by running time, and look around."""
        while (left := deadline - self._time.now()) > 0:
            self._receive(left)
        if (now := self._time.now()) >= self._look_at:
            self._look(now)

    def _receive(self, timeout_s: float) -> int | None:
        """Take in one message; return its sender, or None if none came in time or it was none of a drone of this flight."""
        return self._take(*received) if (received := self._link.receive(timeout_s)) else None

    def _take(self, agent: int, data: bytes) -> int | None:
        """Take in a message; return its sender, or None if it was none of a drone of this flight."""
        peer = self.peers[agent]
        if peer.owes(self._now) and self._said.take_plain(agent, peer.process, data):
            peer.answer(self._now, self._proof)
            self._heard_bytes += len(data)
            return agent
        try:
            message = messages.unpack_from_drone(data, self._mission.agents)
        except messages.MessageError:
            peer.says(self._time.now())
            return None
        answers = isinstance(message, messages.Reply) and message.process == peer.process
        if not (answers and peer.answer(message.tick, message.proof)):  # type: ignore[union-attr]
            peer.says(self._time.now())
            answers = False
        if isinstance(message, messages.Hello):
            self._greet(agent, message)
            return agent
        if message.process != peer.process:
            self._reception.refuse(agent, message.process)
            return None
        self._reception.heard(agent)
        if isinstance(message, messages.Reply):
            if answers:
                self._heard_bytes += len(data)
                self._said.take(agent, message)
        elif isinstance(message, messages.Ready):
            self._take_ready(agent, peer)
        else:
            self._farewells[agent] = message.status
        return agent

    def _greet(self, agent: int, hello: messages.Hello) -> None:
        if wrong := self._reception.refuse_version(agent, hello):
            if not self._started:
                raise ServerError(wrong)  # no single drone ends a flight that has begun
        elif not self.core.flying[0, agent]:
            self._reception.send(agent, messages.Bye())
        elif self._reception.greet(agent, hello, self._time.now(), self._control.paused(agent)):
            self.director.invariants[0].renew(agent)

    def _take_ready(self, agent: int, peer: Peer) -> None:
        """This drone is there, and has read what it was sent: a Tick without an answer was lost, or its answer was. In lockstep
        it is asked again; in real time the next one will do."""
        peer.arrive()
        if self._clock == "realtime":
            if peer.backlogged:
                peer.excuse()
        elif peer.ask_again(self._time.now()):
            self._link.send(agent, peer.question)
