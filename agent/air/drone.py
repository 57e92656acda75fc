"""One drone on the air, tick by tick: a vehicle, what is heard, the pilot, the guard, and the mission's own drone. No input or
output but the vehicle's.

    hear     what others say goes into the contacts, what the operator says to the pilot
    fly      agent.process.Drone acts, from the tick of `go` until it is on the ground: who holds or lands is still a neighbour
    judge    the guard looks at where it is and what it is about to be told
    pilot    the phase changes, and the vehicle is told; or it is told where to be
    say      a beacon with the frame, when one is due, and now and then an account
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from agent.air.body import RoomBody
from agent.air.commands import Commands
from agent.air.contacts import Contact, Contacts, tick_of
from agent.air.guard import Action, Situation, Verdict, bounds_of, judge
from agent.air.log import FlightLog
from agent.air.nature import NatureHeard
from agent.air.obstacles import MapSource, Obstacles
from agent.air.pace import Pace
from agent.air.peers import OPERATOR as THE_OPERATOR
from agent.air.peers import Said, drone_of
from agent.air.pilot import IN_FLIGHT, Facts, Patience, Phase, Pilot, step
from agent.air.preflight import complaints
from agent.air.reach import reach_of
from agent.air.vehicle import Mode, Setpoint, State, Vector, Vehicle, VehicleError
from agent.process import Drone
from agent.slot_endpoints import SealsOf
from protocols.dynamics import TICK_S
from protocols.fleet.plan import Plan
from protocols.slots.seals import Stamps
from protocols.wire.account import Account, shown
from protocols.wire.beacon import NO_TICK, Beacon, pack_beacon, unpack_beacon
from protocols.wire.nature import WORLD, pack_status, to_drone
from protocols.wire.operator import Order, unpack_word

_ACCOUNT_TICKS = 25
_AGAIN_S = 0.3  # an order to the vehicle that shows no effect is given again
_LATEST_GO_S = 1.0  # who hears of it later does not run after the others
_HEARD_S = 0.5
_ARM_S = 3.0  # so long an order to arm stands
_DONE: dict[Phase, Callable[[State], bool]] = {
    Phase.GROUND: lambda state: not state.armed,
    Phase.ARMED: lambda state: state.armed,
    Phase.CLIMB: lambda state: state.mode is not Mode.GROUND,
    Phase.HOLD: lambda state: state.mode is not Mode.FOLLOW and state.mode is not Mode.CLIMB,
    Phase.LAND: lambda state: state.mode in (Mode.LAND, Mode.GROUND, Mode.DEAD),
    Phase.DEAD: lambda state: state.mode is Mode.DEAD,
}

Flying = Callable[[bytes], SealsOf]  #: what identifies a flight -> what is sealed with in it


class AirDrone:
    """Drone ``me`` of a plan."""

    def __init__(
        self, plan: Plan, me: int, vehicle: Vehicle, version: str, sealing: Flying = lambda flight: Stamps
    ) -> None:
        self.plan, self.me, self.vehicle = plan, me, vehicle
        self.pilot = Pilot()
        self.log = FlightLog(plan)
        self.events: list[tuple[float, Phase, tuple[str, ...]]] = []  # UTC [s], the phase begun, why
        self.missed = 0
        self._version, self._sealing = version, sealing
        self._contacts = Contacts(me, reach_of(plan))
        self._nature = NatureHeard(plan) if plan.fleet.world else None
        sources = (MapSource(plan.obstacles), *([self._nature] if self._nature else ()))
        self._obstacles = Obstacles(sources)
        self._body = RoomBody(plan, me, self._contacts, self._obstacles, vehicle.lags)
        self._bounds = bounds_of(plan)
        self._patience = Patience(plan.fleet.guard.hold_s, plan.fleet.guard.abort_s)
        self._every = plan.mission.frame_every
        self._drone: Drone | None = None
        self._order: Order | None = None
        self._commands = Commands(plan.fleet.guard.operator_hold_s)
        self._go: int | None = None  # tick of UTC
        self._before: tuple[State, float] | None = None  # as the vehicle said, and when
        self._low_since = math.inf  # its battery
        self._astray = (0.0, 0.0, 0.0)  # by which what it says of its position has jumped in this flight
        self._stand = Setpoint((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self._asked_at = 0.0
        self._arm_until = 0.0
        self._was_armed = False
        self._pace = Pace()

    def hear(self, said: Said, now: float) -> None:
        """What somebody said; ``now``: s, of a clock that never steps. What cannot be, or in another's name, is not heard."""
        try:
            if said.kind == "word" and said.who == THE_OPERATOR:
                if (order := self._commands.hear(unpack_word(said.data), now)) is not None:
                    self._order = order
                    self._arm_until = now + _ARM_S if order is Order.ARM else now
            elif said.who == WORLD and self._nature:
                if said.kind == to_drone("nature", self.me):
                    self._nature.hear(said.data, now)
                elif said.kind == to_drone("carried", self.me):
                    for sender, data in self._nature.carried(said.data):
                        self._hear_beacon(sender, data, said.at_us, now)
            elif said.kind == "beacon" and not self._nature:
                self._hear_beacon(drone_of(said.who), said.data, said.at_us, now)
        except ValueError:  # a word, a beacon or an account that cannot be read: all say so
            return

    def _hear_beacon(self, sender: int, data: bytes, at_us: int, now: float) -> None:
        beacon, frame = unpack_beacon(data)
        if beacon.sender == sender < self.plan.mission.agents:
            self._contacts.hear(beacon, frame, at_us, now)

    @property
    def flown_s(self) -> float:
        """Since `go`; before, less than nothing."""
        return -1.0 if self._drone is None or self._go is None else self._drone.tick * TICK_S

    def land(self) -> None:
        """As if the operator had ordered it."""
        self._order = Order.LAND

    def give_up(self) -> None:
        """The process cannot go on."""
        with suppress(VehicleError):
            self.vehicle.land()

    def step(self, utc_us: int, now: float) -> list[tuple[str, bytes]]:
        """One tick. What is to be said, by kinds.

        Raises:
            agent.air.vehicle.VehicleError: the vehicle cannot be reached any more.
            agent.policy.PolicyError: the policy raised.
        """
        (state, jump_m), utc_tick = self._measure(now), tick_of(utc_us)
        self._pace.tick(utc_tick)
        self._obstacles.look()
        order, self._order = self._order, None
        if now < self._arm_until and self.pilot.phase is Phase.GROUND:
            order = order or Order.ARM  # what spoke against it a moment ago may be over
        else:
            self._arm_until = now  # who was armed once is not armed again by the same word
        if order is Order.GO and (word := self._commands.word) and self.pilot.phase is Phase.FORM:
            late = (utc_tick - word.at_tick) * TICK_S
            self._go = word.at_tick if late < _LATEST_GO_S else None
        tick = NO_TICK if self._go is None else max(NO_TICK, utc_tick - self._go)
        setpoint = self._setpoint(state, tick, now)
        verdict = self._judge(state, jump_m, setpoint, now)
        changed = self._decide(state, order, verdict, tick, utc_us, now)
        if changed:
            self._enter(state, utc_us)
        elif self.pilot.phase in (Phase.FORM, Phase.FLY) and setpoint and verdict.action is Action.PASS:
            self.vehicle.fly(setpoint)
        elif now - self._asked_at > _AGAIN_S and not self._obeyed(state):
            self._tell_vehicle()
            self._asked_at = now
        if changed:
            self._asked_at = now
        return self._said(state, tick, utc_us, now, changed)

    def _setpoint(self, state: State, tick: int, now: float) -> Setpoint | None:
        """Let the mission's drone act where there is a mission; where to be, in a phase that says it."""
        phase = self.pilot.phase
        self._body.frame = self._body.status = None
        if phase is Phase.FORM:
            return self._stand
        if (
            phase not in (Phase.FLY, Phase.HOLD, Phase.LAND)
            or self._drone is None
            or tick <= self._drone.tick
        ):
            return None
        if phase is Phase.FLY and self._drone.tick >= 0:
            self.missed += tick - self._drone.tick - 1
        self._body.measure(state, tick, now)
        self._drone.act(tick)
        return self._body.setpoint if phase is Phase.FLY else None

    def _measure(self, now: float) -> tuple[State, float]:
        """The vehicle's state, and how far its position has moved at once [m].

        Who sees its own position jump holds, and says to the others that it is where it was: there they must not fly.
        """
        said, jump = self.vehicle.state(), (0.0, 0.0, 0.0)
        if self._before is not None and self.pilot.phase in IN_FLIGHT:
            before, dt_s = self._before[0], now - self._before[1]
            jump = _minus(_minus(said.p, before.p), _times(before.v, dt_s))
        length = math.hypot(*jump)
        if length > self.plan.fleet.guard.jump_m:
            self._astray = _minus(self._astray, _times(jump, -1.0))
        elif self.pilot.phase not in IN_FLIGHT:
            self._astray = (0.0, 0.0, 0.0)
        self._before = said, now
        low = said.battery < self.plan.fleet.guard.battery_land
        self._low_since = min(self._low_since, now) if low else math.inf
        return replace(said, p=_minus(said.p, self._astray)) if any(self._astray) else said, length

    def _judge(self, state: State, jump_m: float, setpoint: Setpoint | None, now: float) -> Verdict:
        seen = Situation(
            state, jump_m, setpoint, self._contacts.movers(now), self._obstacles.discs,
            self._contacts.few_s(self.plan.mission.agents - 1, now),
            self._commands.silent_s(now),
            self._contacts.clock_s(now), max(0.0, now - self._low_since),
        )  # fmt: skip
        return judge(seen, self._bounds)

    def _decide(
        self, state: State, order: Order | None, verdict: Verdict, tick: int, utc_us: int, now: float
    ) -> bool:
        """Let the pilot decide; whether the phase changed."""
        facts = Facts(
            now, order, state.mode, verdict, tick >= 0, tick > self.plan.ticks,
            order is Order.ARM and not self.complaints(state, now), self._was_armed and not state.armed,
        )  # fmt: skip
        self._was_armed = state.armed
        before, self.pilot = self.pilot, step(self.pilot, facts, self._patience)
        if self.pilot.phase is before.phase:
            return False
        self.events.append((utc_us / 1e6, self.pilot.phase, self.pilot.reasons))
        return True

    def complaints(self, state: State, now: float) -> list[str]:
        """What speaks against arming it."""
        silent_s = self._commands.silent_s(now)
        operator = silent_s is not None and silent_s < self.plan.fleet.guard.operator_hold_s
        clock_s = self._contacts.clock_s(now)
        found = complaints(self.plan, self.me, state, self._heard(now), clock_s, operator, self._pace.lacking)
        worldly = self._nature.complaint(now) if self._nature else None
        return [worldly, *found] if worldly else found

    def _heard(self, now: float) -> list[int]:
        known = self._contacts.known().items()
        return [number for number, contact in known if now - contact.heard_at < _HEARD_S]

    def _enter(self, state: State, utc_us: int) -> None:
        """The phase has changed."""
        phase = self.pilot.phase
        if phase is Phase.ARMED and (word := self._commands.word) is not None:
            # Now, for it takes a moment, and the motors of nobody turn yet. The order's number is of no other flight.
            flight = f"{self.plan.fleet_digest} {word.number}".encode()
            agents = self.plan.mission.agents
            self._drone = Drone(
                self.plan.mission, self.me, bytes(range(agents)), 0, self._body, self._body,
                seals_of=self._sealing(flight),
            )  # fmt: skip
            self._drone.open()
            self._go, self.missed, self._body.slot, self.log = None, 0, self.me, FlightLog(self.plan)
        elif phase is Phase.FORM:
            height = self.plan.height(self.me)
            self._stand = self._stand._replace(p=(*state.p[:2], height), yaw=self.plan.place.yaw)
        elif phase is Phase.FLY:
            self._body.begin(state)
        self._tell_vehicle()

    def _tell_vehicle(self) -> None:
        vehicle, phase = self.vehicle, self.pilot.phase
        if phase is Phase.ARMED:
            vehicle.arm()
        elif phase is Phase.CLIMB:
            vehicle.take_off(self.plan.height(self.me))
        elif phase is Phase.HOLD:
            vehicle.hold()
        elif phase in (Phase.LAND, Phase.GROUND):
            vehicle.land()
        elif phase is Phase.DEAD:
            vehicle.kill()

    def _obeyed(self, state: State) -> bool:
        done = _DONE.get(self.pilot.phase)
        return done is None or done(state)

    def _said(
        self, state: State, tick: int, utc_us: int, now: float, changed: bool
    ) -> list[tuple[str, bytes]]:
        said, utc_tick, phase = [], tick_of(utc_us), self.pilot.phase
        flying = state.mode is not Mode.GROUND and not (phase is Phase.DEAD and state.p[2] < 0.1)
        in_mission = self._drone is not None and tick >= 0 and phase in IN_FLIGHT and phase is not Phase.FORM
        about, late_ms = self._contacts.lateness(utc_tick // self._every, now)
        beacon = Beacon(
            self.me, list(Phase).index(phase), self._body.slot, tick if in_mission else NO_TICK, utc_us, state.p, state.v,
            round(min(1000 * state.age_s, 60000.0)),
            about, late_ms, round(100 * state.battery), flying,
        )  # fmt: skip
        if self._body.frame is not None or (utc_tick % self._every == 0 and not in_mission):
            said.append(("beacon", pack_beacon(beacon, self._body.frame or b"")))
        if self._nature:
            said.append(("pose", pack_beacon(beacon)))
            if self._body.status is not None:
                said.append(("status", pack_status(self._body.status)))
        if tick >= 0 and (phase in IN_FLIGHT or phase is Phase.DEAD):
            self.log.record(tick, {**self._contacts.known(), self.me: Contact(beacon, now)}, now)
        if changed or utc_tick % _ACCOUNT_TICKS == 0:
            said.append(("account", self.account(state, now).to_json()))
        return said

    def account(self, state: State, now: float) -> Account:
        """Its account of itself."""
        clock = self._contacts.clock_s(now)
        return Account(
            drone=self.me,
            phase=self.pilot.phase,
            mode=state.mode,
            complaints=tuple(map(shown, self.complaints(state, now)))
            if self.pilot.phase is Phase.GROUND
            else (),
            reasons=tuple(map(shown, self.pilot.reasons)),
            heard=tuple(sorted(self._heard(now))),
            clock_ms=None if clock is None else round(1000 * clock, 2),
            slot=self._body.slot,
            ticks=max(0, self._drone.tick + 1) if self._drone else 0,
            missed=self.missed,
            rejected=sum(self._drone.rejected.values()) if self._drone else 0,
            fleet=self.plan.fleet_digest,
            mission=self.plan.mission_digest,
            version=self._version,
        )


def _minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _times(a: Vector, factor: float) -> Vector:
    return factor * a[0], factor * a[1], factor * a[2]
