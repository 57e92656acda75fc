"""For tests of a controller of one's own: missions in which things go wrong, drawn by Hypothesis, and what they must keep.

    from hypothesis import given
    from rsc_swarm.testing import SETTINGS, missions

    @SETTINGS
    @given(missions(agents=4, policy=Homing, budget="none,kill=1,part=1"))
    def test_it_survives(swarm, mission):
        swarm.survives(mission)

``swarm`` is a fixture of the pytest plugin (rsc_swarm.testing.plugin), which comes with the package.
"""

from pathlib import Path
from typing import Any

from hypothesis import Phase, settings
from hypothesis.strategies import SearchStrategy

from protocols.mission.document import Mission
from rsc_swarm import api
from rsc_swarm.campaign import strategies
from rsc_swarm.campaign.budget import parse_budget
from rsc_swarm.testing.swarm import Broke, Swarm

__all__ = ["SETTINGS", "Broke", "Swarm", "missions"]

#: of Hypothesis, for flights: they take a while, so there are few, and no more than one thing that broke is looked into
SETTINGS = settings(
    deadline=None,
    max_examples=20,
    phases=[Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink],
    report_multiple_bugs=False,
)


def missions(
    source: str | Path | None = None, /, budget: str | None = None, **fields: Any
) -> SearchStrategy[Mission]:
    """A mission on any map, from any start, with as much going wrong as the budget allows.

    Args:
        source, fields: the mission, as of rsc_swarm.mission. budget: as ``--budget`` of rsc-swarm campaign (docs/campaigns.md).

    Raises:
        MissionError: it cannot be flown; one line says what would be right.
    """
    return strategies.missions(api.mission(source, **fields), parse_budget(budget))
