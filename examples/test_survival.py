# test_survival.py
from hypothesis import given

from rsc_swarm.testing import SETTINGS, missions

BUDGET = "none,kill=1,part=1,loss=0.2"


@SETTINGS
@given(mission=missions(agents=4, policy="homing.py:Homing", obstacles={"discs": []}, budget=BUDGET))
def test_it_survives(swarm, mission):
    swarm.survives(mission)
