"""The virtual target: what a drone knows of it, without being told."""

import numpy as np

from agent.target import place_target
from agent.tick_arrays import empty_work
from protocols.mission.document import parse_mission
from rsc_swarm.flight.simulate import Simulation


def test_the_target_flies_along_x_from_the_origin_at_the_missions_speed() -> None:
    work = empty_work(np.array([0, 1]))
    place_target(250, 1, 3.0, work)
    assert work.target_position.tolist() == [[0.0, 0.0], [7.5, 0.0]]
    assert work.target_velocity.tolist() == [[0.0, 0.0], [3.0, 0.0]]


def test_every_drone_knows_bit_for_bit_where_the_referee_has_the_target() -> None:
    simulation = Simulation([parse_mission({"agents": 3, "target": {"speed_mps": 2.7}})])
    for _ in range(50):
        there = simulation.world.target[0]
        simulation.tick()
        assert simulation.agents._work.target_position.tolist() == [[there, 0.0]] * 3
