"""Real time over bad networks, without sockets: drones fly on, brake when they must, and come back when they can."""

from typing import Any

import numpy as np
import pytest

from protocols.dynamics import TICK_S
from protocols.mission.document import Mission, MissionError, parse_mission
from tests.virtual_net import Network, VirtualNet, fly
from world.failsafe import Failsafe
from world.server.running_time import RunningTime
from world.server.session import WorldServer

CUT = Network(delay_s=0.002, cuts=((1.0, 6.0, (2,)),))


def mission(**fields: Any) -> Mission:
    return parse_mission({"agents": 4, "fly_s": 8, "obstacles": {"discs": []}, **fields})


def speeds(task: Mission, network: Network, agent: int) -> tuple[Any, list[float]]:
    """The flight, and how fast a drone was after each tick."""
    net, fast = VirtualNet(task, network), []
    world = WorldServer(
        task, net, "realtime", net, lambda core: fast.append(float(np.hypot(*core.velocity[0, agent])))
    )
    world._time = RunningTime(lambda: net.now)
    return world.run(), fast


def test_a_drone_that_is_cut_off_brakes_to_a_hover_and_takes_part_again_within_a_second() -> None:
    flown, fast = speeds(mission(), CUT, 2)
    assert flown.outcome.lost_agents == ()
    assert max(fast[100:130]) > 1.0, "first it flies by its last command"
    assert fast[250:600] == [0.0] * 350
    assert fast[650] > 1.0
    ages = flown.command_ages
    assert 5.0 <= ages.longest_s[2] < 5.1
    assert 4.6 < ages.braked_s[2] < 4.8
    assert max(ages.longest_s[agent] for agent in (0, 1, 3)) < 0.05
    assert ages.landed == ()


def test_who_brakes_brakes_no_harder_than_it_can_and_does_not_turn_back() -> None:
    _, fast = speeds(mission(), CUT, 2)
    brakes = np.diff(fast[131:250])
    assert brakes.min() >= -10.0 * TICK_S - 1e-9
    assert brakes.max() <= 0.0


def test_where_the_mission_says_so_it_lands_and_the_others_close_ranks() -> None:
    flown, _ = speeds(mission(failsafe={"then": "land"}), CUT, 2)
    assert flown.outcome.lost_agents == flown.command_ages.landed == (2,)
    assert flown.outcome.struck_off == (), "the mission has said it"


def test_everybody_cut_off_at_once_hovers_and_flies_on() -> None:
    flown, _ = speeds(mission(), Network(0.002, cuts=((1.0, 6.0, (0, 1, 2, 3)),)), 0)
    assert flown.outcome.lost_agents == ()
    assert all(5.0 <= longest < 5.1 for longest in flown.command_ages.longest_s)


def test_a_drone_that_the_mission_has_frozen_is_not_braked_for_its_silence() -> None:
    faults = [{"at_s": 1, "kind": "freeze", "agents": [1]}, {"at_s": 3, "kind": "thaw", "agents": [1]}]
    flown, _ = speeds(mission(fly_s=4, faults=faults), Network(0.002), 1)
    assert max(flown.command_ages.longest_s) < 0.05


@pytest.mark.parametrize("loss", [0.1, 0.3])
def test_over_a_slow_and_lossy_network_four_drones_get_there(loss: float) -> None:
    """50 +- 10 ms each way. Of many flights: docs/networks.md."""
    flown = fly(parse_mission({"agents": 4, "map_seed": 3}), Network(0.05, 0.01, loss), seed=3)
    assert flown.outcome.success
    assert flown.command_ages is not None
    assert 0.09 < flown.command_ages.p99_s < 0.2
    assert sum(flown.command_ages.braked_s) < 0.1


def test_the_ages_of_commands_are_added_up() -> None:
    watch = Failsafe(mission())
    awake, velocity, command = np.ones(4, bool), np.zeros((4, 2)), np.ones((4, 2))
    for tick in range(200):
        answered = np.array([tick, tick - 3, tick, tick if tick < 100 else 99])
        watch.replace_old(tick, answered, awake, velocity, command)
    ages = watch.ages()
    assert ages.longest_s == (0.0, 0.03, 0.0, 1.0)
    assert ages.braked_s == (0.0, 0.0, 0.0, 0.7)
    assert (ages.p99_s, ages.misses) == (0.92, 300)


def test_a_failsafe_that_is_none_is_refused() -> None:
    with pytest.raises(MissionError, match=r"failsafe.then"):
        mission(failsafe={"then": "coast"})
    with pytest.raises(MissionError, match=r"failsafe.after_s"):
        mission(failsafe={"after_s": 0})
