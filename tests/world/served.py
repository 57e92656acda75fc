"""A small flight over bytes in this process, and what is said of a drone that is lost from it; the fixture ``impatient`` is in
conftest.py.
"""

from typing import Any

from protocols.mission.document import Mission, parse_mission
from protocols.wire import messages
from protocols.wire.messages import Reply
from world.outcome import Flown, StruckOff


def mission(fly_s: float = 0.6, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "fly_s": fly_s, "obstacles": {"count": [1, 1]}, **fields})


def told(reply: bytes) -> Reply:
    message = messages.unpack_from_drone(reply, 6)
    assert isinstance(message, Reply)
    return message


def assert_struck_off(flown: Flown, agent: int, at_s: float, why: str) -> None:
    """This drone alone was lost, and everybody else flew to the end."""
    outcome = flown.outcome
    assert outcome.struck_off == (StruckOff(agent, at_s, why),)
    assert (outcome.lost_agents, outcome.ticks) == ((agent,), 60)
    assert (outcome.success, outcome.failure, outcome.rest_failure) == (False, "broken", "late")


SILENT = "it has not answered for 0.7 s"
