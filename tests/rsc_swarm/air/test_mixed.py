"""Mixed reality: drones with bodies of their own fly by the radio of a world, around obstacles that only it knows."""

from typing import Any

import numpy as np
import pytest

from agent.air.peers import OPERATOR, Said
from agent.air.pilot import Phase
from protocols.fleet.plan import Plan
from protocols.mission.document import MissionError, parse_mission, read_mission_fields
from protocols.wire.frames import REASONS
from protocols.wire.nature import WORLD, pack_status
from protocols.wire.operator import Order, Word, pack_word
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from rsc_swarm.air.mixed import MixedWorld, mixed_mission
from rsc_swarm.flight.report import report_of
from tests.agent.air.faults import ROOM
from tests.agent.air.hall import MISSIONS, Hall, plan_of

VIRTUAL = (-1.6, -0.35, 0.12)  # in the way of the triangle
BAD_RADIO = {
    "radio": {"frame_rate_hz": 25, "burst": {"loss": 0.3}},
    "faults": [{"at_s": 2, "kind": "loss", "loss": 0.2}],
}


def plan_with(*obstacles: tuple[float, float, float], noise_m: float = 0.0) -> Plan:
    return plan_of("lab-small", **ROOM, world={"obstacles_m": list(obstacles), "noise_m": noise_m})


def world_of(plan: Plan, **changes: Any) -> MixedWorld:
    fields = read_mission_fields(MISSIONS / "lab-small.yaml")
    return MixedWorld(plan, mixed_mission(plan, parse_mission(fields | changes)))


class MixedHall(Hall):
    """A hall with a world, which stops when ``world`` is taken away."""

    def __init__(self, plan: Plan, world: MixedWorld) -> None:
        super().__init__(plan)
        self.world: MixedWorld | None = world

    def tick(self) -> None:
        if self.world:
            word = pack_word(self.word._replace(utc_us=self.utc_us))
            for who, kind, data in (*self._on_air, (OPERATOR, "word", word)):
                self.world.hear(Said(who, kind, data, self.utc_us), self.now)
            for kind, data in self.world.tick(self.utc_us, self.now):
                self.inject(WORLD, kind, data)
        super().tick()


@pytest.fixture(scope="module")
def flown() -> MixedHall:
    """The lab mission over a bad radio, past a virtual obstacle that is seen with noise."""
    plan = plan_with(VIRTUAL, noise_m=0.03)
    hall = MixedHall(plan, world_of(plan, **BAD_RADIO))
    hall.go(0.0)
    hall.wait(40.0, {Phase.GROUND})
    hall.wait(0.05)
    return hall


def test_they_fly_the_mission_and_land(flown: MixedHall) -> None:
    for drone in flown.drones:
        phases = [phase for _, phase, _ in drone.events]
        assert phases == [Phase.ARMED, Phase.CLIMB, Phase.FORM, Phase.FLY, Phase.LAND, Phase.GROUND], (
            drone.events
        )
    assert flown.world
    assert flown.world.down(flown.now)
    assert flown.closest_m >= flown.plan.limit_m


def test_they_fly_around_an_obstacle_that_only_the_world_knows(flown: MixedHall) -> None:
    paths = np.array(flown.truth)
    gaps = np.linalg.norm(paths[..., :2] - VIRTUAL[:2], axis=2) - VIRTUAL[2]
    assert flown.plan.limit_m <= gaps.min() < 1.0  # they came near it, and not too near
    for drone in flown.drones:
        assert len(drone._obstacles.discs) <= 2  # one on the map, and one however often it was seen


def test_the_report_is_that_of_a_launch(flown: MixedHall) -> None:
    assert flown.world
    mission = flown.world.core.missions[0]
    report = report_of(flown.world.flown(), mission, "world", "realtime", "again")
    assert report.success, report.detail
    assert report.frames.dropped.burst > 50
    assert report.frames.dropped.loss > 50
    assert report.watch.agreed
    assert report.struck_off == ()
    assert report.lost_agents == ()
    assert report.min_distance_m is not None
    assert flown.plan.limit_m <= report.min_distance_m * flown.plan.fleet.scale < 1.0


def test_without_their_world_they_hold_and_land() -> None:
    plan = plan_with()
    hall = MixedHall(plan, world_of(plan))
    hall.go(1.0)
    hall.world = None
    hall.wait(5.5)
    assert hall.phases == {Phase.HOLD}
    assert {why for drone in hall.drones for _, phase, why in drone.events if phase is Phase.HOLD} == {
        ("too few drones heard for 5.0 s",)
    }


def test_a_world_of_another_fleet_file_is_not_believed() -> None:
    hall = MixedHall(plan_with(), world_of(plan_with(VIRTUAL)))
    hall.wait(1.0)
    for drone in hall.drones:
        complaints = drone.complaints(drone.vehicle.state(), hall.now)
        assert complaints[0] == "its world has another fleet file or mission; give both the same"
    hall.world = None
    hall.wait(1.0)
    found = hall.drones[0].complaints(hall.drones[0].vehicle.state(), hall.now)
    assert found[0].startswith("it does not hear the world at udp/127.0.0.1:7457; start it")


@pytest.mark.parametrize("slot", [6, 2**63])
def test_a_drone_that_says_it_holds_a_slot_that_there_is_not_stops_no_world(slot: int) -> None:
    world = world_of(plan_with())
    world.hear(Said(OPERATOR, "word", pack_word(Word(1, Order.GO, 0, 0)), 0), 0.0)
    counts = (0,) * len(REASONS), (0,) * len(SWAP_COUNTS)
    status = AgentStatus(slot, 0, *counts, 0, bytes(range(6)))
    world.hear(Said("1", "status", pack_status(status), 0), 0.0)
    for tick in range(3):
        world.tick(10_000 * tick, 0.01 * tick)
    assert world.core.claim.tolist() == [list(range(6))]
    assert world.core.flying.all()


@pytest.mark.parametrize("kind", ["kill", "freeze", "slow", "restart"])
def test_faults_of_drones_are_not_the_worlds(kind: str) -> None:
    with pytest.raises(
        MissionError, match=f"faults.0.kind: {kind} strikes a drone itself.* part, heal or loss"
    ):
        world_of(plan_with(), faults=[{"at_s": 1, "kind": kind, "agents": [2]}])
