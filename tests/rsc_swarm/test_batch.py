"""The batch simulation flies what drones in a simulation fly, its labels disturb nothing, and its expert arrives."""

from typing import Any

import numpy as np
import pytest

from agent.control.detour import STALLED_TICKS
from protocols.mission.document import Mission, MissionError, parse_mission
from protocols.relative import UNKNOWN
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.stage import FLYING, SUCCEEDED
from rsc_swarm.flight.simulate import Simulation, simulate


def missions(count: int, **fields: Any) -> list[Mission]:
    fields = {"agents": 6, "policy": "analytic", "swap": {"rule": "off"}, **fields}
    return [parse_mission({**fields, "map_seed": 1_000_000 + m, "seed": m}) for m in range(count)]


def fly_out(batch: Batch, **how: Any) -> None:
    batch.fly(batch.mission.ticks, **how)
    assert not (batch.stage.result == FLYING).any()


def test_the_analytic_controller_flies_bit_for_bit_what_it_flies_in_a_simulation() -> None:
    batch, simulation = Batch(missions(2)), Simulation(missions(2))
    for _ in range(10):
        batch.fly(37, analytic=True)
        for _ in range(37):
            simulation.tick()
        assert np.array_equal(batch.stage.position, simulation.world.position)
        assert np.array_equal(batch.stage.velocity, simulation.world.velocity)


@pytest.mark.parametrize("agents", [6, 12])
def test_whoever_aims_by_the_leader_flies_bit_for_bit_so_too(agents: int) -> None:
    """On starts this wide some leaders are two and three hops away, and some out of reach."""
    fields: dict[str, Any] = {"agents": agents, "aim": "chain", "start": {"radius_m": 6}}
    batch, simulation = Batch(missions(2, **fields)), Simulation(missions(2, **fields))
    hops: set[int] = set()
    for _ in range(8):
        batch.fly(37, analytic=True)
        for _ in range(37):
            simulation.tick()
            hops |= set(simulation.agents._memory.hops.ravel().tolist())
        assert np.array_equal(batch.stage.position, simulation.world.position)
    assert {1, 2, 3, UNKNOWN} <= hops


def test_a_label_leaves_what_was_heard_as_it_was() -> None:
    fields: dict[str, Any] = {"aim": "chain", "start": {"radius_m": 6}}
    batch, untouched = Batch(missions(2, **fields), papers=True), Batch(missions(2, **fields), papers=True)
    for _ in range(5):
        batch.label(20)
        for one in (batch, untouched):
            one.fly(15, analytic=True)
        assert np.array_equal(batch.stage.target, untouched.stage.target)
        assert np.array_equal(batch.stage.position, untouched.stage.position)


def test_leader_and_follower_swap_only_where_all_they_affect_are_connected() -> None:
    """As in the paper: at most once a second for whoever asks, who is the leader."""
    fields: dict[str, Any] = {"agents": 12, "aim": "chain", "start": {"scrambled": True}}
    made = {}
    for connected in (False, True):
        swap = {"rule": "tree", "protocol": "highest-version", "cooldown_s": 1, "connected": connected}
        batch = Batch(missions(4, swap=swap, **fields), papers=True)
        batch.fly(600)
        made[connected] = int(batch.stage.swaps.sum())
    assert 0 < made[True] < made[False]


def test_detours_are_flown_bit_for_bit_as_in_a_simulation() -> None:
    fields = {"obstacles": {"count": [14, 16], "y_m": [-8, 8]}}
    batch, simulation = Batch(missions(2, **fields)), Simulation(missions(2, **fields))
    ticks_on_detours = 0
    for _ in range(40):
        batch.fly(10, analytic=True)
        for _ in range(10):
            simulation.tick()
            ticks_on_detours += int((simulation.agents._memory.stalled > STALLED_TICKS).sum())
        assert np.array_equal(batch.stage.position, simulation.world.position)
    assert ticks_on_detours > 20


def test_observations_are_those_of_the_drones_at_this_and_the_last_three_ticks() -> None:
    batch, simulation = Batch(missions(2)), Simulation(missions(2))
    batch.fly(20, analytic=True)
    batch.fly(2, analytic=True)
    seen = []
    for _ in range(23):  # what a drone observes at a tick is known only once it has flown it
        simulation.tick()
        seen.append(simulation.agents._work.observation.reshape(2, 6, 18).astype(np.float32))
    assert np.array_equal(batch.stage.observation, np.stack(seen[-4:]))


def test_both_agree_on_how_and_when_a_flight_ends() -> None:
    batch, outcomes = Batch(missions(3)), simulate(missions(3))
    fly_out(batch, analytic=True)
    for world, outcome in enumerate(outcomes):
        ours = batch.outcome(world)
        assert (ours.success, ours.ticks, ours.tau_s, ours.formed_s) == (
            outcome.success,
            outcome.ticks,
            outcome.tau_s,
            outcome.formed_s,
        )
        assert ours.min_distance_m == outcome.min_distance_m


def test_labels_are_what_the_expert_then_flies_and_leave_no_trace() -> None:
    batch, untouched = Batch(missions(2)), Batch(missions(2))
    for one in (batch, untouched):
        one.fly(100)
    start, speed = batch.stage.position.copy(), batch.stage.velocity.copy()
    displacement, velocity_change = batch.label(20)
    for one in (batch, untouched):
        one.fly(20)
    assert np.array_equal(batch.stage.position, untouched.stage.position)
    assert np.allclose(displacement[:, :, -1], batch.stage.position - start - 0.2 * speed, atol=1e-6)
    assert np.allclose(velocity_change[:, :, -1], batch.stage.velocity - speed, atol=1e-6)


def test_a_plan_of_the_experts_own_is_flown_as_the_expert_flies() -> None:
    batch, expert = Batch(missions(2)), Batch(missions(2))
    for _ in range(30):
        displacement, velocity_change = batch.label(20)
        acceleration = np.diff(velocity_change, axis=2, prepend=0) / 0.01
        batch.fly(20, acceleration, displacement)
        expert.fly(20)
    assert np.abs(batch.stage.position - expert.stage.position).max() < 0.2


def test_the_expert_arrives_and_reconfigures_on_the_way() -> None:
    batch = Batch(missions(4, swap={"rule": "contact"}, start={"scrambled": True}))
    fly_out(batch)
    assert (batch.stage.result == SUCCEEDED).all()
    assert (batch.stage.swaps > 0).all()
    assert sorted(batch.stage.claim[0].tolist()) == list(range(6))


def test_a_world_begins_again_as_if_it_were_new() -> None:
    batch, fresh = Batch(missions(2)), Batch(missions(2)[:1])
    batch.fly(300)
    batch.restart(1, missions(1)[0])
    batch.fly(50)
    fresh.fly(50)
    assert np.array_equal(batch.stage.position[1], fresh.stage.position[0])
    assert np.array_equal(batch.stage.observation[:, 1], fresh.stage.observation[:, 0])


@pytest.mark.parametrize(
    ("field", "fields"),
    [
        ("faults", {"faults": [{"at_s": 1, "kind": "kill", "agents": [0]}]}),
        ("radio", {"radio": {"loss": 0.1}}),
        ("radio.frame_rate_hz", {"radio": {"frame_rate_hz": 10}}),
        ("radio.range_m", {"aim": "chain", "radio": {"range_m": 7}}),
    ],
)
def test_what_the_batch_leaves_out_is_refused(field: str, fields: dict[str, Any]) -> None:
    with pytest.raises(MissionError, match=f"^{field}: "):
        Batch(missions(1, **fields))
