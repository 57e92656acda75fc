"""What a drone with a valid key tells its operator that no honest drone would."""

import io
import json

import pytest
from rich.console import Console

from agent.air.peers import Said, name_of
from agent.air.pilot import Phase
from rsc_swarm.air.desk import Desk
from rsc_swarm.air.station import Station
from rsc_swarm.show.fleet_view import _Told, table, troubles_text
from tests.rsc_swarm.air.stations import hear, station

NOW = 100.0


def tells(fleet: Station, **lies: object) -> None:
    """Drone 0's account, with these lies in it."""
    honest = json.loads(fleet.accounts[0].to_json())
    fleet.hear(Said(name_of(0), "account", json.dumps(honest | lies).encode(), round(1e6 * NOW)), NOW)


def shown(fleet: Station) -> str:
    """What the operator's terminal is sent."""
    to = io.StringIO()
    screen = Console(file=to, force_terminal=True, width=100)
    screen.print(table(fleet, NOW), troubles_text(fleet, NOW))
    for line in _Told().lines(fleet, Desk(), NOW):
        screen.print(line, markup=False)
    return to.getvalue()


@pytest.mark.parametrize(
    "lies",
    [
        {"phase": "[/red]"},
        {"phase": "\x1b[2J"},
        {"phase": "nowhere"},
        {"reasons": ["\x1b]0;yours\x07"], "phase": "hold"},
        {"complaints": ["green\n\nand red"]},
        {"version": "1\x1b[8m"},
        {"clock_ms": 1e300},
        {"slot": 10**40},
        {"missed": -1},
        {"heard": [-1, 10**30]},
    ],
)
def test_what_no_drone_tells_is_neither_believed_nor_shown(lies: dict[str, object]) -> None:
    fleet = station()
    hear(fleet, NOW, Phase.FLY)
    before = shown(fleet)
    tells(fleet, **lies)
    assert shown(fleet) == before


def test_who_changes_its_phase_all_the_time_fills_no_memory() -> None:
    fleet = station()
    hear(fleet, NOW, Phase.FLY)
    for number in range(3000):
        tells(fleet, phase=("hold", "land")[number % 2])
    hear(fleet, NOW + 1.0, Phase.LAND)
    assert len(fleet.events) < 1100
    assert [phase for _, drone, phase, _ in fleet.events if drone == 1] == [Phase.FLY, Phase.LAND]
