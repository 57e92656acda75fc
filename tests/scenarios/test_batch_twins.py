"""One trajectory three ways: a batch episode, a flight in one process, a flight in real processes."""

import numpy as np

import rsc_swarm as rs
from protocols.mission.document import parse_mission
from rsc_swarm.batch.batch import Batch
from rsc_swarm.flight.simulate import Simulation

MISSION = parse_mission(
    {"agents": 6, "policy": "analytic", "swap": {"rule": "off"}, "map_seed": 1_000_003, "fly_s": 2.0}
)


def test_a_batch_a_simulation_and_a_launch_fly_one_trajectory() -> None:
    launched = rs.launch(
        MISSION
    ).trajectory.positions  # by a launcher of its own: other tests open Zenoh in this process
    assert len(launched) > MISSION.ticks
    batch, simulation = Batch([MISSION]), Simulation([MISSION])
    for position in launched[: MISSION.ticks]:
        assert np.array_equal(simulation.world.position[0], position)
        assert np.array_equal(batch.stage.position[0], position)
        batch.fly(1, analytic=True)
        simulation.tick()
