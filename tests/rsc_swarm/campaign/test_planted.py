"""What campaigns are for: rules with a fault in them are found out. The hunt itself is `planted`, which takes minutes; here the
missions that it found are flown."""

from pathlib import Path

import pytest

from rsc_swarm.campaign.kept import fly_kept, read_kept
from tests.rsc_swarm.campaign.planted import FEW, PLANTED

MISSIONS = Path(__file__).parent / "planted_missions"


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_breaks_a_short_mission_that_the_sound_code_keeps(name: str) -> None:
    kept = read_kept(MISSIONS / f"{name}.yaml")
    assert len(kept.mission.faults) <= FEW
    with PLANTED[name].in_place():
        broken = fly_kept(kept).broken
    assert broken
    assert broken.name == kept.broke
    assert fly_kept(kept).broken is None
