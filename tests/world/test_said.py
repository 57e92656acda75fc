"""What drones have said in a tick, as the world takes it."""

from protocols.mission.document import parse_mission
from protocols.slots.written import pack_slots
from protocols.wire.messages import Reply
from protocols.wire.status import AgentStatus
from world.core import WorldCore
from world.server.said import Said


def test_accounts_of_a_drone_that_catches_up_are_taken_in_the_order_in_which_it_gave_them() -> None:
    """In real time it may answer two ticks in one: what it counted in the second is no less than in the first."""
    said = Said(WorldCore([parse_mission({"agents": 3})]))
    said.begin(7)
    for agent, heard in ((2, 0), (1, 9), (1, 1)):
        status = AgentStatus(0, heard, (), (), 0, pack_slots([0, 1, 2]))
        said.take(agent, Reply(0, 7, 0, 0.0, 0.0, 0, None, status))
    told = [(agent, status.heard) for agent, status in said.answers().accounts]
    assert told == [(1, 9), (1, 1), (2, 0)]
