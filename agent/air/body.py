"""Body and radio (agent.ports) of a drone on the air, without input and output: a mission flown in a room.

What is sensed is the vehicle's own state and what obstacles are known, both turned into the mission's frame; neighbours are known
from frames alone. What is wanted, an acceleration, goes into a reference by which the vehicle is led: it is integrated as the
mission's dynamics have it, and leaks towards what is measured, so that the two cannot part. Of a vehicle that lags that reference
is what is sensed and told: controllers take a body for one that does at once what they want, and would swing with one that does
not. The guard looks at where it is.
"""

import math

import numpy as np

from agent.air.contacts import Contacts
from agent.air.obstacles import Obstacles
from agent.air.vehicle import Setpoint, State
from agent.ports import Heard, heard_of
from protocols.dynamics import TICK_S, integrate
from protocols.fleet.place import Flat
from protocols.fleet.plan import Plan
from protocols.wire.sensed import MAX_OBSTACLES, empty_sensed
from protocols.wire.status import AgentStatus

_LEAK_P, _LEAK_V = 0.5, 1.0  # per second
_CLIMB_MPS = 0.3  # from one slot's height to another's
_SILENT_S = 0.5  # then the frames of a drone are believed no more, and it becomes an obstacle
_ROOM_BYTES = 1 << 15  # of the frames of a tick
_DRONE_M = 0.5  # its radius as an obstacle, in the mission's metres


class RoomBody:
    """Both ports of the drone ``me`` that flies ``plan`` among ``contacts`` and ``obstacles``."""

    def __init__(self, plan: Plan, me: int, contacts: Contacts, obstacles: Obstacles, lags: bool) -> None:
        self._plan, self._me, self._contacts, self._obstacles = plan, me, contacts, obstacles
        self._place, self._lags = plan.place, lags
        self.sensed = empty_sensed(1)
        self._reach = plan.mission.sensing.range_m
        self._p: Flat = (0.0, 0.0)
        self._v: Flat = (0.0, 0.0)
        self._measured = (self._p, self._v)
        self._height = 0.0
        self._room = np.zeros(_ROOM_BYTES, np.uint8)
        self._tick, self._now = 0, 0.0
        self.slot = me
        self.setpoint: Setpoint | None = None
        self.frame: bytes | None = None
        self.status: AgentStatus | None = None

    def begin(self, state: State) -> None:
        """The mission starts where the vehicle is."""
        self._p, self._v = self._place.to_mission(state.p[:2]), (0.0, 0.0)
        self._height = state.p[2]

    def measure(self, state: State, tick: int, now: float) -> None:
        """What the vehicle says at the beginning of a tick; ``now``: s, of a clock that never steps."""
        self._measured = self._place.to_mission(state.p[:2]), self._place.turned_back(state.v[:2])
        self._tick, self._now, self.frame = tick, now, None

    def sense(self) -> None:
        sensed, place = self.sensed, self._place
        (px, py), velocity = (self._p, self._v) if self._lags else self._measured
        sensed.position[0], sensed.velocity[0] = (px, py), velocity
        near = self._obstacles.nearest(*place.to_room((px, py)), self._reach * place.scale)
        discs = [(*place.to_mission((x, y)), radius / place.scale) for x, y, radius in near]
        count = 0
        for x, y, radius in (*self._silent(), *discs):
            if math.hypot(x - px, y - py) - radius <= self._reach and count < MAX_OBSTACLES:
                sensed.obstacles[0, count] = x - px, y - py, radius
                count += 1
        sensed.obstacle_count[0] = count

    def fly(self, ax: float, ay: float) -> None:
        limits, (p, v) = self._plan.mission.limits, self._measured
        moved = integrate(self._p, self._v, (ax, ay), limits.acceleration_mps2, limits.speed_mps, TICK_S)
        self._p, self._v = _leaked(moved[0], p, _LEAK_P * TICK_S), _leaked(moved[1], v, _LEAK_V * TICK_S)
        wanted = self._plan.height(self.slot)
        climb = max(-_CLIMB_MPS, min(_CLIMB_MPS, (wanted - self._height) / TICK_S))
        self._height += climb * TICK_S
        place = self._place
        self.setpoint = Setpoint(
            (*place.to_room(self._p), self._height),
            (*place.turned(self._v), climb),
            (*place.turned((ax, ay)), 0.0),
            place.yaw,
        )

    def hear(self) -> Heard:
        """Those within the range of the mission's radio, as their beacons have it."""
        reach = self._plan.mission.radio.range_m * self._place.scale
        here = self._place.to_room(self._measured[0])
        known = self._contacts.known()
        return heard_of(
            [
                (sender, frame)
                for sender, frame in self._contacts.frames(self._tick)
                if math.dist(known[sender].beacon.p[:2], here) <= reach
            ],
            self._room,
        )

    def say(self, frame: bytes) -> None:
        self.frame = frame

    def report(self, slot: int, status: AgentStatus | None) -> None:
        self.slot, self.status = slot, status

    def _silent(self) -> list[tuple[float, float, float]]:
        """Drones that fell silent in flight: obstacles of the mission where they must have stopped."""
        return [
            (*self._place.to_mission(mover.p[:2]), _DRONE_M)
            for mover in self._contacts.movers(self._now)
            if self._now - self._contacts.known()[mover.number].heard_at > _SILENT_S
        ]


def _leaked(value: Flat, towards: Flat, share: float) -> Flat:
    return value[0] + share * (towards[0] - value[0]), value[1] + share * (towards[1] - value[1])
