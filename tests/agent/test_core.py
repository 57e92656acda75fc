"""AgentCore: one tick of a drone, alone or as one row of many."""

from typing import Any

import numpy as np
import pytest

from agent.core import AgentCore
from agent.policy import PolicyError
from agent.rules import shape_of
from protocols.mission.document import Mission, parse_mission
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.flight.simulate import Simulation, simulate


def mission(**fields: Any) -> Mission:
    return parse_mission({"agents": 6, "fly_s": 2.0, "obstacles": {"discs": []}, **fields})


def flown(task: Mission, ticks: int) -> Simulation:
    simulation = Simulation([task])
    for _ in range(ticks):
        simulation.tick()
    return simulation


def test_depth_counts_the_edges_up_to_the_root() -> None:
    line = parse_mission({"agents": 5, "formation": {"shape": "line"}})
    assert shape_of(line).depth.tolist() == [2, 1, 0, 1, 2]
    square = [4, 3, 2, 3, 4, 3, 2, 1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 2, 3, 4, 3, 2, 3, 4]
    assert shape_of(parse_mission({})).depth.tolist() == square


def test_an_unknown_policy_is_refused_when_the_drone_is_made() -> None:
    task = mission(policy="nobody")
    with pytest.raises(PolicyError, match="unknown policy 'nobody'"):
        AgentCore(task, [0], np.arange(6, dtype=np.int16)[None])


@pytest.mark.parametrize(("rate", "every"), [(100, 1), (50, 2), (10, 10)])
def test_frames_come_at_their_rate_and_not_all_in_one_tick(rate: float, every: int) -> None:
    simulation = Simulation([mission(radio={"frame_rate_hz": rate})])
    sent = []
    for _ in range(40):
        simulation.tick()
        sent.append(simulation.world._sizes[0, (simulation.clock - 1) % simulation.world.ring] > 0)
    assert np.sum(sent, axis=0).tolist() == [40 // every] * 6
    if every > 5:
        assert np.sum(sent, axis=1).max() == 1


def test_the_safety_filter_can_be_left_out() -> None:
    # The policy looks at nobody, and an obstacle stands in the way of drone 0.
    fields = {
        "policy": "cruise",
        "start": {"radius_m": 0},
        "obstacles": {"discs": [[16, 0.1, 1.5]]},
        "fly_s": 8.0,
    }
    assert simulate([mission(**fields, safety_filter=False)])[0].failure == "collision"
    assert simulate([mission(**fields)])[0].failure != "collision"


def test_scrambled_drones_sort_out_their_slots_and_all_come_to_know() -> None:
    simulation = flown(mission(start={"scrambled": True}, seed=6), 190)
    views = simulation.agents._views.slot_of
    counts = [party.counts for party in simulation.agents._endpoints.endpoint]
    assert sum(count.committed for count in counts) > 0
    assert (views == views[0]).all(), "one view"
    assert simulation.world.claim[0].tolist() == views[0].tolist()
    assert sorted(views[0].tolist()) == list(range(6))


def test_without_swaps_everyone_keeps_the_slot_it_started_in() -> None:
    simulation = flown(mission(start={"scrambled": True}, seed=6, swap={"rule": "off"}), 150)
    assert simulation.world.claim[0].tolist() == simulation.world.initial_slots[0].tolist()


def test_the_slot_of_a_dead_leader_is_taken_and_only_a_leaf_stays_empty() -> None:
    # In the triangle of six, slot 1 leads the apex, slot 0.
    faults = [{"at_s": 0.5, "kind": "kill", "slots": [1]}]
    simulation = flown(
        mission(faults=faults, start={"radius_m": 1}, swap={"silent_s": 0.5, "rule": "tree"}), 199
    )
    assert simulation.agents._views.slot[0] == 1
    assert simulation.agents._endpoints.endpoint[0].counts.vacated == 1
    assert {int(simulation.agents._views.slot_of[agent, 0]) for agent in (0, 2, 3, 4, 5)} == {1}


def test_nobody_is_taken_for_dead_who_is_only_out_of_ones_own_reach() -> None:
    simulation = flown(mission(agents=25, start={"radius_m": 1}, swap={"silent_s": 0.5}), 150)
    assert sum(party.counts.vacated for party in simulation.agents._endpoints.endpoint) == 0
    # Corner to corner it is eight hops, and every hop rounds up to the next tenth of a second.
    assert (simulation.clock - 1 - simulation.agents._memory.last_seen[0, 24]) < 100


def test_the_status_tells_what_the_drone_believes_and_has_done() -> None:
    simulation = flown(mission(start={"radius_m": 0.5}), 50)
    status = simulation.agents.status(4, simulation.clock, (0,) * 7)
    assert status.slot == 4
    assert status.view == bytes(range(6))
    # Slot 4, the root of the triangle: four neighbours at five metres.
    assert status.heard == 4
    assert len(status.swaps) == len(SWAP_COUNTS)


def test_a_restarted_row_knows_nothing_and_learns_its_slot_from_the_others() -> None:
    restart = {"at_s": 1.5, "kind": "restart", "slots": [5]}
    simulation = flown(mission(start={"scrambled": True}, seed=6, faults=[restart]), 150)
    agents = simulation.agents
    known = agents._views.slot_of[1].copy()
    assert known.tolist() != simulation.world.initial_slots[0].tolist()
    assert simulation.world.initial_slots[0, 3] == 5
    simulation.tick()
    assert agents._views.slot_of[3].tolist() == simulation.world.initial_slots[0].tolist()
    for _ in range(10):
        simulation.tick()
    assert agents._views.slot_of[3].tolist() == known.tolist()


def test_a_swarm_that_only_hears_its_neighbours_flies_too() -> None:
    outcome = simulate([mission(sensing={"neighbours": "heard"}, fly_s=21.0)])[0]
    assert outcome.success, outcome


def test_a_swarm_that_follows_its_leaders_flies_too() -> None:
    outcome = simulate([mission(aim="chain", fly_s=21.0)])[0]
    assert outcome.success, outcome
