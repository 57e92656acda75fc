"""``rs.launch``: real processes from a program, whatever that program has open already."""

import pytest

import rsc_swarm as rs


def test_a_launch_from_a_program_is_the_flight_of_its_simulation(tmp_path):
    mission = rs.mission(agents=3, fly_s=1.0, faults=[{"at_s": 0.5, "kind": "restart", "agents": [1]}])
    simulated = rs.simulate(mission)  # this process now has a model open, which must not be forked
    launched = rs.launch(mission, run_dir=tmp_path / "run")
    assert launched.report.mode == "launch"
    assert launched.report.digest == simulated.report.digest
    assert (launched.trajectory.positions == simulated.trajectory.positions).all()
    assert (tmp_path / "run" / "logs" / "agent-1.log").is_file()


def test_what_a_launcher_refuses_is_raised_here_in_its_words():
    with pytest.raises(rs.MissionError, match=r"^policy nowhere.py:Mine: nowhere.py cannot be read"):
        rs.launch(rs.mission(policy="nowhere.py:Mine"))
