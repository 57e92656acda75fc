"""Mixed reality, the world's part: it carries what drones say, shows them its obstacles, and judges. No input or output.

Before `go` all that is said reaches all at once. In the mission its radio and its faults decide what reaches whom, by where the
drones are, and the world's referee judges. After it all reaches all again, until everybody is down.
"""

import math
import random
import time

from agent.air.contacts import Contacts, mover_of, tick_of
from agent.air.peers import OPERATOR, Said, drone_of
from agent.air.reach import reach_of
from protocols.dynamics import TICKS_PER_S
from protocols.fleet.plan import Plan
from protocols.mission.document import Mission, MissionError, parse_mission
from protocols.wire.beacon import record_of, unpack_beacon
from protocols.wire.heard import pack_heard
from protocols.wire.nature import Nature, pack_nature, to_drone, unpack_status
from protocols.wire.operator import Order, unpack_word
from world.core import WorldCore
from world.director import Director
from world.external import Carried, ExternalSwarm
from world.outcome import Flown
from world.outlets.recorder import Recorder

_NATURE_TICKS = 10
_LATEST_GO_TICKS = 100
_GONE_S = 4.0  # a drone that says nothing for so long has landed by its vehicle's failsafe
_WORLDS = ("loss", "burst", "delay_ms", "jitter_ms", "duplicate", "reorder", "range_m")  # fields of the radio
_FAULTS = ("part", "heal", "loss")


def mixed_mission(plan: Plan, asked: Mission) -> Mission:
    """What the world of ``plan`` flies: the drones' mission with the radio, faults and seed of ``asked``, and all obstacles.

    Raises:
        MissionError: ``asked`` differs in what the drones have to know, or has faults that are not the world's.
    """
    for index, fault in enumerate(asked.faults):
        if fault.kind not in _FAULTS:
            raise MissionError(
                f"faults.{index}.kind: {fault.kind} strikes a drone itself, and here it is outside of the world; "
                f"do it by hand, or write {', '.join(_FAULTS[:-1])} or {_FAULTS[-1]}"
            )
    fields, other = plan.mission.model_dump(mode="json"), asked.model_dump(mode="json")
    fields["radio"] |= {name: other["radio"][name] for name in _WORLDS}
    discs = [*plan.mission_obstacles, *map(plan.in_mission, plan.virtual_obstacles)]
    fields |= {name: other[name] for name in ("faults", "seed", "success", "hold_s")}
    fields |= {"obstacles": fields["obstacles"] | {"discs": discs}, "time_limit_s": plan.ticks / TICKS_PER_S}
    # They stand where the fleet file has them.
    fields["start"] = {"radius_m": 0.0, "gap_m": fields["limits"]["collision_m"]}
    return parse_mission(fields, f"mission {asked.name}")


class MixedWorld:
    """The world of ``plan`` that flies ``mission``.

    Attributes:
        core: the world. director: who flies it. recorder: what is kept of it.
    """

    def __init__(self, plan: Plan, mission: Mission) -> None:
        self._plan, self._agents = plan, mission.agents
        self.core, self.recorder = WorldCore([mission]), Recorder(mission)
        self._swarm = ExternalSwarm(self.core)
        self.director = Director(self.core, self._swarm)
        self._poses = Contacts(None, reach_of(plan))
        self._go: int | None = None
        self._waiting: dict[int, bytes] = {}  # outside of the mission: the newest of each
        self._noise = random.Random(mission.seed)
        self._began = self._first_tick_at = 0.0
        self._took_s = 0.0

    def hear(self, said: Said, now: float) -> None:
        """What somebody said; ``now``: s, of a clock that never steps. What cannot be, or in another's name, is not heard."""
        try:
            if said.who == OPERATOR:
                word = unpack_word(said.data)
                if word.order is Order.GO and self._go is None:
                    late = tick_of(said.at_us) - word.at_tick
                    self._go = word.at_tick if late < _LATEST_GO_TICKS else None
                return
            drone = drone_of(said.who)
            if drone >= self._agents:
                return
            if said.kind == "beacon":
                self._says(drone, said.data)
            elif said.kind == "pose":
                beacon, _ = unpack_beacon(said.data)
                if beacon.sender == drone:
                    self._poses.hear(beacon, b"", said.at_us, now)
            elif said.kind == "status" and self._going_on:
                self._swarm.tells(drone, unpack_status(said.data, self._agents))
        except ValueError:  # a word, a beacon or an account that cannot be read: all say so
            return

    @property
    def _going_on(self) -> bool:
        return self._go is not None and bool(self.core.active[0])

    def _says(self, drone: int, data: bytes) -> None:
        if self.begun and self._going_on:
            self._swarm.says(drone, data, record_of(data))
        else:
            self._waiting[drone] = data

    def tick(self, utc_us: int, now: float) -> list[tuple[str, bytes]]:
        """Go on to this moment; what is to be said, by kinds."""
        utc_tick = tick_of(utc_us)
        waiting, self._waiting = self._waiting, {}
        carried: list[Carried] = [
            (to, drone, data) for drone, data in waiting.items() for to in range(self._agents) if to != drone
        ]
        while self._going_on and self._go is not None and self._go + self.director.clock <= utc_tick:
            carried += self._fly(now)
        reached: dict[int, list[tuple[int, bytes]]] = {}
        for to, source, data in carried:
            reached.setdefault(to, []).append((source, data))
        said = [(to_drone("carried", to), pack_heard(beacons)) for to, beacons in reached.items()]
        if utc_tick % _NATURE_TICKS == 0:
            said += [
                (to_drone("nature", to), pack_nature(self._nature(to, now))) for to in range(self._agents)
            ]
        return said

    def _fly(self, now: float) -> list[Carried]:
        """One tick of the mission; what reaches somebody in it."""
        core, place = self.core, self._plan.place
        for drone, contact in self._poses.known().items():
            mover = mover_of(contact, now)
            self._swarm.is_at(drone, place.to_mission(mover.p[:2]), place.turned_back(mover.v[:2]))
            if not contact.beacon.flying or now - contact.heard_at > _GONE_S:
                core.land(0, drone)
        if not self.begun:
            self._began, self._first_tick_at = time.perf_counter(), time.time()
            self._swarm.settle()
            self.recorder.record(core)
        self.director.tick()
        self.recorder.record(core)
        self._took_s = time.perf_counter() - self._began
        return self._swarm.carried

    def _nature(self, drone: int, now: float) -> Nature:
        plan, world = self._plan, self._plan.fleet.world
        assert world
        seen = []
        if (contact := self._poses.known().get(drone)) is not None:
            x, y, _ = mover_of(contact, now).p
            reach = plan.mission.sensing.range_m * plan.fleet.scale
            for disc in plan.virtual_obstacles:
                if math.dist((x, y), disc[:2]) - disc[2] <= reach:
                    noisy = [self._noise.gauss(value, world.noise_m) for value in disc]
                    seen.append((noisy[0], noisy[1], max(noisy[2], disc[2] / 2)))
        return Nature(plan.fleet_digest, plan.mission_digest, world.noise_m, seen)

    def down(self, now: float) -> bool:
        """Whether the mission is over, and nobody who is heard is in the air."""
        known = self._poses.known().values()
        up = any(each.beacon.flying for each in known if now - each.heard_at < _GONE_S)
        return self._go is not None and not self._going_on and not up

    @property
    def begun(self) -> bool:
        """Whether the mission has begun."""
        return self._began > 0.0

    def flown(self) -> Flown:
        """What came of the mission, or would if it ended now."""
        return self.director.flown(self._took_s, self._first_tick_at)

    def leave(self) -> None:
        """End the mission as it is."""
        if self._going_on:
            self.director.leave()
