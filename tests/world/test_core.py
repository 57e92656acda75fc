"""WorldCore: faults in their tick, many worlds as if each were alone, a digest that misses nothing."""

from typing import Any

import numpy as np
import pytest

from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import Simulation, simulate
from world.core import Answers, WorldCore


def mission(**fields: Any) -> Mission:
    return parse_mission({"agents": 6, "fly_s": 1.0, **fields})


def world(*faults: dict[str, Any], **fields: Any) -> WorldCore:
    return WorldCore([mission(faults=list(faults), **fields)])


def at(tick: int, kind: str, **what: Any) -> dict[str, Any]:
    return {"at_s": tick / 100, "kind": kind, **what}


def drift(core: WorldCore, ticks: int, command: float = 0.0) -> list[tuple[int, str, tuple[int, ...]]]:
    """Let ticks pass with one command for all; which faults happened when."""
    happened = []
    for _ in range(ticks):
        now = int(core.tick[0])
        happened += [(now, event.fault.kind, event.agents) for event in core.begin_tick()]
        core.perceive()
        core.advance(Answers(np.full((6, 2), command), np.full(6, 100), np.arange(6)))
    return happened


def test_drones_start_at_rest_and_the_target_at_the_origin() -> None:
    core = world()
    assert not core.velocity.any()
    assert core.target[0] == 0.0
    drift(core, 50)
    assert core.target[0] == pytest.approx(1.5)


def test_a_fault_happens_at_the_beginning_of_its_tick_and_names_its_drones() -> None:
    core = world(at(3, "kill", agents=[4]), at(3, "slow", agents=[0, 1]), at(7, "recover", agents=[0]))
    assert drift(core, 10) == [(3, "kill", (4,)), (3, "slow", (0, 1)), (7, "recover", (0,))]
    assert core.flying[0].tolist() == [True] * 4 + [False, True]


def test_a_fault_of_a_slot_strikes_whoever_holds_it_at_the_start() -> None:
    core = world(at(2, "kill", slots=[3]), start={"scrambled": True}, seed=5)
    holder = int(np.flatnonzero(core.initial_slots[0] == 3)[0])
    assert core.initial_slots[0].tolist() != list(range(6))
    assert drift(core, 5) == [(2, "kill", (holder,))]
    assert not core.flying[0, holder]


def test_a_frozen_drone_coasts_and_is_neither_asked_nor_heard() -> None:
    core = world(at(2, "freeze", agents=[0]), at(6, "thaw", agents=[0]))
    drift(core, 2, command=2.0)
    speed = core.velocity[0, 0].copy()
    drift(core, 4, command=2.0)
    assert core.velocity[0, 0].tolist() == speed.tolist()
    assert core.rows_awake.tolist() == [False] + [True] * 5
    sent = int(core.tally[0, 0])
    assert sent == 2 * 6 + 4 * 5
    drift(core, 1, command=2.0)
    assert core.rows_awake.all()
    assert core.velocity[0, 0].tolist() != speed.tolist()


def test_no_thaw_revives_the_dead() -> None:
    core = world(at(0, "freeze", agents=[0]), at(1, "kill", agents=[0]), at(2, "thaw", agents=[0]))
    drift(core, 4)
    assert (bool(core.flying[0, 0]), bool(core.responsive[0, 0])) == (False, False)


def test_a_restarted_drone_rises_at_rest_where_it_fell() -> None:
    core = world(at(20, "kill", agents=[0]), at(30, "restart", agents=[0]))
    drift(core, 20, command=3.0)
    place = core.position[0, 0].tolist()
    drift(core, 10, command=3.0)
    assert core.position[0, 0].tolist() == place
    core.begin_tick()
    assert core.flying[0, 0]
    assert core.position[0, 0].tolist() == place
    assert core.velocity[0, 0].tolist() == [0.0, 0.0]


def test_a_part_keeps_groups_from_each_other_until_it_heals() -> None:
    part = at(0, "part", groups=[[0, 1, 2], [3, 4, 5]])
    core = world(part, at(10, "heal"), start={"radius_m": 0})
    drift(core, 10)
    parted = int(core.tally[0, 5])
    assert parted > 0
    drift(core, 10)
    assert core.tally[0, 5] == parted


def test_a_drone_that_was_lost_is_named_in_the_outcome() -> None:
    core = world(at(0, "kill", agents=[1, 5]))
    drift(core, 100)
    outcome = core.outcomes[0]
    assert outcome is not None
    assert (outcome.failure, outcome.lost_agents) == ("late", (1, 5))


def test_a_flight_ended_from_outside_says_why() -> None:
    core = world()
    drift(core, 5)
    core.end(0, "interrupted")
    outcome = core.outcomes[0]
    assert outcome is not None
    assert (outcome.success, outcome.failure, outcome.ticks, core.active[0]) == (
        False,
        "interrupted",
        5,
        False,
    )


SEEDS = [(0, 0), (1, 7), (2, 8)]
RADIO = {"loss": 0.2, "jitter_ms": 20, "duplicate": 0.1, "reorder": 0.1, "burst": {"loss": 0.2}}


def test_many_worlds_at_once_fly_as_each_would_alone() -> None:
    tasks = [
        mission(map_seed=map_seed, seed=seed, radio=RADIO, start={"scrambled": True})
        for map_seed, seed in SEEDS
    ]
    together = simulate(tasks)
    alone = [simulate([task])[0] for task in tasks]
    assert together == alone
    assert len({outcome.digest for outcome in together}) == 3


def test_worlds_of_a_batch_end_each_in_its_own_time() -> None:
    fast = {"obstacles": {"discs": []}, "fly_s": 21.0, "goal_x_m": 5.0}
    ticks = [outcome.ticks for outcome in simulate([mission(seed=seed, **fast) for seed in (1, 2, 3)])]
    assert len(set(ticks)) == 3
    assert ticks == [simulate([mission(seed=seed, **fast)])[0].ticks for seed in (1, 2, 3)]


def test_faults_of_one_world_leave_the_others_alone() -> None:
    calm, struck = mission(seed=4), mission(seed=4, faults=[at(20, "kill", agents=[2])])
    outcomes = simulate([calm, struck, calm])
    assert outcomes[0] == outcomes[2] == simulate([calm])[0]
    assert outcomes[1] == simulate([struck])[0]
    assert outcomes[1].lost_agents == (2,)


@pytest.mark.parametrize(
    "other", [{"seed": 1}, {"obstacles": {"discs": [[10, 0, 2]]}}, {"radio": {"loss": 0.1}}]
)
def test_the_digest_tells_flights_apart(other: dict[str, Any]) -> None:
    assert simulate([mission()])[0].digest == simulate([mission()])[0].digest
    assert simulate([mission(**other)])[0].digest != simulate([mission()])[0].digest


def test_the_digest_sees_the_smallest_step_aside() -> None:
    flights = []
    for nudge in (0.0, 1e-15):
        simulation = Simulation([mission(fly_s=0.2)])
        simulation.world.position[0, 3, 0] += nudge
        while simulation.world.active.any():
            simulation.tick()
        outcome = simulation.world.outcomes[0]
        assert outcome is not None
        flights.append(outcome.digest)
    assert flights[0] != flights[1]


def test_a_dense_swarms_frames_have_the_size_the_wire_would_give_them() -> None:
    crowd = mission(agents=49, formation={"spacing_m": 2.5}, start={"radius_m": 0}, fly_s=0.05)
    simulation = Simulation([crowd])
    for _ in range(4):
        simulation.tick()
    first = ((simulation.clock - 1) % simulation.world.ring) * 49
    air, sizes = simulation._air, simulation.world._sizes[0, 3 % simulation.world.ring]
    assert air.frames.known_count[first : first + 49].max() >= 32
    for row in range(49):
        assert sizes[row] == len(air.pack(first + row))
