"""The recorder keeps what happened, however long it takes."""

import numpy as np

from protocols.mission.document import Mission
from world.core import WorldCore
from world.outlets.recorder import Recorder


def test_a_long_flight_is_kept_whole(tmp_path):
    mission = Mission(agents=2)
    core = WorldCore([mission])
    recorder = Recorder(mission)
    for row in range(5000):
        core.position[0] = row
        core.claim[0] = row % 2
        recorder.record(core)
    recorder.save(tmp_path / "long.npz")
    with np.load(tmp_path / "long.npz") as saved:
        np.testing.assert_array_equal(saved["positions"][:, 1, 0], np.arange(5000))
        np.testing.assert_array_equal(saved["slots"][:, 0], np.arange(5000) % 2)
        assert saved["flying"].all()
        np.testing.assert_array_equal(saved["obstacles"], core.obstacles[0, : core.obstacle_count[0]])
        assert saved["goal_x"] == core.goal_x[0]
        assert saved["tick_s"] == 0.01
    assert [path.name for path in tmp_path.iterdir()] == ["long.npz"]
