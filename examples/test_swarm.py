# test_swarm.py
import pytest

import rsc_swarm as rs

MAPS = range(1_000_000, 1_000_002)


@pytest.mark.parametrize(
    "fault",
    [
        {"at_s": 3, "kind": "kill", "slots": [8]},
        {"at_s": 3, "kind": "restart", "slots": [4]},
        {"at_s": 0, "kind": "slow", "slots": [4], "factor": 0.5},
    ],
    ids=lambda fault: fault["kind"],
)
def test_the_formation_survives(fault):
    flights = rs.simulate([rs.mission(agents=9, map_seed=m, seed=1000 * m, faults=[fault]) for m in MAPS])
    failed = [
        f"{flight.report.detail}: {flight.report.again}" for flight in flights if not flight.report.success
    ]
    assert not failed
