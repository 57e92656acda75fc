"""What a drone on the air senses of itself: where its vehicle is, or, of one that lags, where it was told to be."""

import pytest

from agent.air.body import RoomBody
from agent.air.contacts import Contacts
from agent.air.obstacles import Obstacles
from agent.air.reach import reach_of
from agent.air.vehicle import Mode, State
from tests.agent.air.hall import plan_of


@pytest.mark.parametrize("lags", [False, True])
def test_one_that_lags_is_steered_by_where_it_was_told_to_be(lags: bool) -> None:
    """It has been told to be on its way for a third of a second, and stands yet."""
    plan = plan_of()
    body = RoomBody(plan, 0, Contacts(0, reach_of(plan)), Obstacles(()), lags)
    state = State((*plan.starts[0], 1.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 1.0, Mode.FOLLOW, armed=True)
    body.begin(state)
    for tick in range(33):
        body.measure(state, tick, 0.01 * tick)
        body.sense()
        body.fly(5.0, 0.0)
    speed = float(body.sensed.velocity[0, 0])
    assert (1.2 < speed < 1.6) if lags else speed == 0.0
