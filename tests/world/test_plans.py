"""Where drones plan to be, in a flight over bytes: told only where somebody looks on, and believed only where it could be."""

import numpy as np
import pytest
from numpy.typing import NDArray

from protocols.mission.document import Mission
from protocols.wire import messages
from protocols.wire.planned import PLAN_BYTES, SHOWN, Planned, are_near, pack_plan, unpack_plans
from rsc_swarm.flight.simulate import Simulation, simulate
from tests.loopback import Loopback, Meddle
from tests.world.served import mission, told
from world.director import Director
from world.outcome import Flown
from world.server.session import WorldServer

TASK = mission(
    policy="rsc-h20",
    faults=[
        {"at_s": 0.2, "kind": "kill", "agents": [1]},
        {"at_s": 0.25, "kind": "restart", "agents": [3]},
        {"at_s": 0.3, "kind": "freeze", "agents": [4]},
    ],
)
LIAR = 2


class LookingOn:
    """Notes what is planned as each tick begins."""

    def __init__(self) -> None:
        self.plans: list[NDArray[np.float32] | None] = []

    def attend(self, director: Director) -> float:
        self.plans.append(director.plans())
        return 0.0


def seen(task: Mission, meddle: Meddle | None = None) -> tuple[list[NDArray[np.float32] | None], Flown]:
    swarm, onlooker = Loopback(task, meddle), LookingOn()
    return onlooker.plans, WorldServer(task, swarm, "lockstep", swarm, onlooker=onlooker).run()


def simulated(task: Mission) -> list[NDArray[np.float32]]:
    simulation, plans = Simulation([task]), []
    while simulation.world.active.any():
        told = simulation.director.plans()
        assert told is not None
        plans.append(told)
        simulation.tick()
    return plans


def planning(plans: NDArray[np.float32] | None) -> list[bool]:
    assert plans is not None
    alive: list[bool] = np.isfinite(plans).any(axis=(1, 2)).tolist()
    return alive


def test_who_looks_on_sees_the_plans_that_a_simulation_shows() -> None:
    plans, flown = seen(TASK)
    assert flown.outcome == simulate([TASK])[0]
    assert plans[0] is None, "before the first tick nobody has planned"
    for tick, (over_bytes, expected) in enumerate(zip(plans[1:-1], simulated(TASK)[1:], strict=True), 1):
        assert over_bytes is not None
        np.testing.assert_array_equal(over_bytes, expected, err_msg=f"tick {tick}")
    assert planning(plans[15]) == [True] * 6
    assert planning(plans[50]) == [True, False, True, True, False, True]


@pytest.mark.parametrize("policy", ["rsc-h1", "analytic", "cruise"])
def test_who_plans_nothing_that_lasts_tells_nothing(policy: str) -> None:
    plans, _ = seen(mission(policy=policy))
    assert set(plans) == {None}


def test_where_nobody_looks_on_no_plan_is_told() -> None:
    said: list[messages.Reply] = []

    def listen(agent: int, tick: int, reply: bytes) -> list[bytes]:
        said.append(told(reply))
        return [reply]

    swarm = Loopback(TASK, listen)
    WorldServer(TASK, swarm, "lockstep", swarm).run()
    assert not any(reply.plan for reply in said)
    said.clear()
    seen(TASK, listen)
    assert {len(reply.plan) for reply in said} == {0, PLAN_BYTES}


def of(after: list[int], place: float) -> bytes:
    return pack_plan(Planned(np.array(after, np.uint16), np.full((SHOWN, 2), place, np.float32)))


@pytest.mark.parametrize(
    "lie",
    [
        of([5, 10, 15, 20], np.nan),
        of([5, 10, 15, 20], np.inf),
        of([5, 10, 15, 20], 1e38),
        of([5, 10, 15, 20], 500.0),
        bytes(range(PLAN_BYTES)),
        b"\xff" * PLAN_BYTES,
    ],
    ids=["no numbers", "infinite", "huge", "far away", "any bytes", "ones"],
)
def test_a_plan_that_lies_is_not_shown_and_harms_nobody(lie: bytes) -> None:
    def meddle(agent: int, tick: int, reply: bytes) -> list[bytes]:
        return [messages.pack(told(reply)._replace(plan=lie))] if agent == LIAR else [reply]

    task = mission(policy="rsc-h20")
    plans, flown = seen(task, meddle)
    assert flown.outcome == simulate([task])[0], "not even the liar is worse off"
    assert planning(plans[30]) == [agent != LIAR for agent in range(6)]


def test_a_plan_is_near_as_far_as_its_drone_could_fly() -> None:
    planned = unpack_plans(4 * of([1, 10, 50, 100], 0.0))
    position, age = np.array([[0.0, 0.0], [1.05, 0.0], [1.2, 0.0], [1.2, 0.0]]), np.array([0, 0, 0, 2])
    assert are_near(planned, age, position, 5.0).tolist() == [True, True, False, True]
