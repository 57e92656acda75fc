"""A flight whose drones are flown by several threads is the flight that one thread flies."""

from pathlib import Path

import numpy as np
import pytest

from agent.core import AgentCore
from agent.policy import PolicyError
from protocols.mission.document import parse_mission
from rsc_swarm.flight.side_by_side import SideBySide
from rsc_swarm.flight.simulate import Simulation

FAULTS = [
    {"at_s": 0.2, "kind": "kill", "agents": [1]},
    {"at_s": 0.3, "kind": "restart", "agents": [7]},
    {"at_s": 0.4, "kind": "freeze", "agents": [4]},
    {"at_s": 0.6, "kind": "thaw", "agents": [4]},
]


def simulation(threads: int, policy: str = "rsc-h20") -> Simulation:
    fields = {"agents": 12, "policy": policy, "start": {"scrambled": True}, "fly_s": 3, "faults": FAULTS}
    return Simulation([parse_mission(fields)], threads=threads)


@pytest.mark.parametrize("policy", ["rsc-h20", "analytic"])
def test_a_flight_in_parts_is_the_flight_in_one(policy: str) -> None:
    one, several = (simulation(threads, policy) for threads in (1, 5))
    assert isinstance(one.agents, AgentCore)
    assert isinstance(several.agents, SideBySide)
    while one.world.active[0]:
        assert one.tick() == several.tick()
        assert [one.status(row, one.clock) for row in range(12)] == [
            several.status(row, one.clock) for row in range(12)
        ]
        shown = one.plans(0), several.plans(0)
        assert (shown[0] is None) == (shown[1] is None)
        if shown[0] is not None:
            assert np.array_equal(*shown, equal_nan=True)
    assert one.world.outcomes == several.world.outcomes
    assert one.director.flown(1, 0).tally == several.director.flown(1, 0).tally


def test_what_goes_wrong_in_a_thread_is_told_by_name() -> None:
    several = simulation(3)
    several.tick()

    def raises(tick: int, arrays: object, wanted: object) -> None:
        raise ZeroDivisionError("no way")

    several.agents._cores[2].policy.act_on_arrays = raises  # type: ignore[union-attr, method-assign]
    with pytest.raises(PolicyError, match="rsc-h20 raised ZeroDivisionError: no way"):
        several.tick()


def test_somebodys_own_policy_flies_in_one_part(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(
        "import numpy as np\n"
        "class Still:\n"
        "    def __init__(self, mission): pass\n"
        "    def act(self, seen): return np.zeros((len(seen.awake), 2))\n"
    )
    assert isinstance(simulation(3, f"{file}:Still").agents, AgentCore)
