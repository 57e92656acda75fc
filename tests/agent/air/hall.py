"""A hall in which a fleet flies in one process, in a time that passes when it is told to: drones, vehicles, air and operator."""

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.air.drone import AirDrone
from agent.air.peers import OPERATOR, Said, name_of
from agent.air.pilot import Phase
from agent.air.point import PointVehicle
from agent.air.vehicle import Mode, Rig
from protocols.fleet.document import parse_fleet
from protocols.fleet.plan import Plan, make_plan
from protocols.mission.document import parse_mission, read_mission_fields
from protocols.wire.operator import Order, Word, pack_word

MISSIONS = Path(__file__).parents[3] / "rsc_swarm" / "missions"
_EPOCH_US = 1_800_000_000_000_000

Loses = Callable[[str, int, float], bool]  #: from whom, to whom, when [s]: is it lost?


def plan_of(mission: str = "lab", **changes: Any) -> Plan:
    """The plan of a shipped mission with points, in a hall of 12 x 8 m."""
    fields = read_mission_fields(MISSIONS / f"{mission}.yaml")
    fleet: dict[str, Any] = {
        "mission": mission,
        "origin_m": [-5.2, 0],
        "scale": 0.3,
        "fence": {"x_m": [-6, 6], "y_m": [-4, 4]},
        "drones": [{"number": number} for number in range(6)],
    }
    return make_plan(parse_fleet(fleet | changes), parse_mission(fields))


class Hall:
    """``bodies``: what goes wrong with whose vehicle, by number. ``loses``: what the air loses. ``clocks``: whose is off by how
    much [s]."""

    def __init__(
        self,
        plan: Plan,
        bodies: dict[int, str] | None = None,
        loses: Loses = lambda who, to, now: False,
        clocks: dict[int, float] | None = None,
    ) -> None:
        self.plan, self.now, self.loses, self.clocks = plan, 1000.0, loses, clocks or {}
        self.vehicles = [
            PointVehicle(
                (bodies or {}).get(me, ""),
                Rig(me, (*start, 0.0), plan.speed_mps, plan.acceleration_mps2),
                lambda: self.now,
            )
            for me, start in enumerate(plan.starts)
        ]
        self.drones = [AirDrone(plan, me, vehicle, "1") for me, vehicle in enumerate(self.vehicles)]
        self.alive = set(range(len(self.drones)))
        self.operator = True
        self.word = Word(1, Order.NONE, 0, 0)
        self._on_air: list[tuple[str, str, bytes]] = []
        self.truth: list[list[tuple[float, float, float]]] = []
        self._modes: list[tuple[float, list[Mode]]] = []
        for vehicle in self.vehicles:
            vehicle.open(1.0)

    @property
    def utc_us(self) -> int:
        return _EPOCH_US + round(1e6 * self.now)

    def order(self, order: Order) -> None:
        """The operator's next word; `go` is for a second later."""
        at_tick = self.utc_us // 10_000 + 100 if order is Order.GO else 0
        self.word = Word(self.word.number + 1, order, at_tick, 0)

    def inject(self, who: str, kind: str, data: bytes) -> None:
        """Somebody says something."""
        self._on_air.append((who, kind, data))

    def tick(self) -> None:
        self.now += 0.01
        on_air, self._on_air = self._on_air, []
        if self.operator and round(100 * self.now) % 10 == 0:
            on_air.append((OPERATOR, "word", pack_word(self.word._replace(utc_us=self.utc_us))))
        for drone in self.drones:
            if drone.me not in self.alive:
                continue
            utc_us = self.utc_us + round(1e6 * self.clocks.get(drone.me, 0.0))
            for who, kind, data in on_air:
                if who != name_of(drone.me) and not self.loses(who, drone.me, self.now):
                    drone.hear(Said(who, kind, data, utc_us), self.now)
            said = drone.step(utc_us, self.now)
            self._on_air += [(name_of(drone.me), *each) for each in said]
        self._modes.append((self.now, [vehicle.state().mode for vehicle in self.vehicles]))
        self.truth.append([vehicle._p for vehicle in self.vehicles])

    def wait(self, seconds: float, until: Iterable[Phase] = ()) -> None:
        """Let time pass, at most until all that live are in one of these phases."""
        wanted = set(until)
        for _ in range(round(100 * seconds)):
            self.tick()
            if wanted and self.phases <= wanted:
                return

    @property
    def phases(self) -> set[Phase]:
        """Of those that live."""
        return {self.drones[me].pilot.phase for me in self.alive}

    def up(self) -> None:
        """Preflight, arm, take off."""
        self.wait(1.0)
        self.order(Order.ARM)
        self.wait(1.0, {Phase.ARMED})
        self.order(Order.TAKEOFF)
        self.wait(10.0, {Phase.FORM})
        assert self.phases == {Phase.FORM}

    def go(self, seconds: float) -> None:
        """Up, and so many seconds of the mission."""
        self.up()
        self.order(Order.GO)
        self.wait(1.0 + seconds)

    def when(self, me: int, phase: Phase) -> float:
        """When a drone entered a phase, in this hall's time."""
        ((at, why),) = [(at, why) for at, entered, why in self.drones[me].events if entered is phase]
        assert why
        return self.hall_time(at)

    def hall_time(self, utc_s: float) -> float:
        """A moment of UTC in this hall's time."""
        return utc_s - _EPOCH_US / 1e6

    def when_mode(self, me: int, mode: Mode, since: float) -> float:
        """When a drone's vehicle was first in a mode after ``since``."""
        return next(now for now, modes in self._modes if now >= since and modes[me] is mode)

    @property
    def slot_error_m(self) -> float:
        """The worst distance of a drone from its slot at the end of the mission, of those that flew so long, in the room."""
        errors = [0.0]
        for drone in self.drones:
            if ("over",) in [why for _, _, why in drone.events]:
                tick = self.plan.ticks
                slot = self.plan.slots_at(tick)[drone.log.slots[tick, drone.me]]
                errors.append(
                    math.dist(self.plan.place.to_room(tuple(drone.log.positions[tick, drone.me])), slot)
                )
        return max(errors)

    @property
    def closest_m(self) -> float:
        """The least distance between two drones in the air, or one and an obstacle's surface, in the room."""
        paths = np.array(self.truth)  # (T, N, 3)
        flying = paths[..., 2] > 0.3
        return min(_between_drones(paths, flying), self._to_obstacles(paths, flying))

    def _to_obstacles(self, paths: NDArray[np.float64], flying: NDArray[np.bool_]) -> float:
        gaps = [
            np.linalg.norm(paths[..., :2] - (x, y), axis=2) - radius for x, y, radius in self.plan.obstacles
        ]
        return min(float(gap[flying].min()) for gap in gaps)


def _between_drones(paths: NDArray[np.float64], flying: NDArray[np.bool_]) -> float:
    least = np.inf
    for one in range(paths.shape[1]):
        for other in range(one):
            both = flying[:, one] & flying[:, other]
            if both.any():
                least = min(least, float(np.linalg.norm(paths[both, one] - paths[both, other], axis=1).min()))
    return least
