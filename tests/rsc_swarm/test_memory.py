"""What is over takes no memory: none of it waits for the collector, which comes late."""

import gc
import subprocess
import sys
from collections.abc import Callable, Iterator
from weakref import ref

import pytest

from agent.process import rehearse
from protocols.mission.document import Mission
from rsc_swarm.flight import warm_up as warming
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.flight.warm_up import warm_up, warm_up_launch

MISSION = Mission(agents=4, policy="analytic")


@pytest.fixture
def uncollected() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("uncollected")
def test_a_flight_in_one_process_is_gone_when_nobody_holds_it() -> None:
    simulation = Simulation([MISSION])
    simulation.tick()
    world, drones = ref(simulation.world), ref(simulation.agents)
    del simulation
    assert (world(), drones()) == (None, None)


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("begin", [rehearse, warm_up])
def test_what_was_tried_before_a_flight_is_gone_when_it_begins(begin: Callable[[Mission], None]) -> None:
    begin(MISSION)
    gc.collect()
    begin(MISSION)
    ours = ("agent", "protocols", "rsc_swarm", "world")
    gc.set_debug(gc.DEBUG_SAVEALL)
    try:
        gc.collect()
        left = [type(thing).__name__ for thing in gc.garbage if type(thing).__module__.split(".")[0] in ours]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
    assert left == []


@pytest.mark.parametrize(("policy", "tried"), [("analytic", 1), ("agent.policy.analytic:Analytic", 2)])
def test_launches_in_a_row_try_a_policy_anew_only_if_it_may_have_changed(
    monkeypatch: pytest.MonkeyPatch, policy: str, tried: int
) -> None:
    mission, rehearsed = Mission(agents=3, policy=policy, seed=2011), []
    monkeypatch.setattr(warming, "warm_up", rehearsed.append)
    monkeypatch.setattr(warming, "warm_up_drone", lambda mission: None)
    warm_up_launch(mission)
    warm_up_launch(mission)
    assert rehearsed == [mission] * tried


LAUNCHES = """
import gc, sys
from protocols.mission.document import parse_mission
from rsc_swarm.flight.launch import launch
mission = parse_mission({"agents": 3, "goal_x_m": 1e6, "obstacles": {"discs": []}, "fly_s": 1})
for count in range(8):
    launch(mission).whole()
    sys._clear_type_cache()  # Python's own, which keeps a name of a few thousand attributes that were looked up
    gc.collect()
    print(sys.getallocatedblocks())
"""


def test_launches_in_a_row_leave_nothing_behind() -> None:
    said = subprocess.run([sys.executable, "-c", LAUNCHES], capture_output=True, text=True, check=True).stdout
    after = [int(line) for line in said.split()]
    assert after[-1] - after[2] < 5, after
