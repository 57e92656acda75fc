"""A tick in one compiled call is answered as any other is, and only where nothing rare happens."""

import pytest

from protocols.mission.document import Mission, parse_mission
from protocols.wire import messages
from protocols.wire.messages import Tick, Welcome, make_tick
from protocols.wire.sensed import SensedPacker, empty_sensed
from tests.loopback import Hosted, Loopback
from world.server.session import WorldServer

ME, TICKS = 2, 160


class Listening(Loopback):
    """A flight of which all is kept that drone `ME` is told."""

    def __init__(self, mission: Mission) -> None:
        self.kept: list[bytes] = []
        super().__init__(mission)
        self.leave_at = TICKS - 1

    def send(self, agent: int, payload: bytes) -> None:
        if agent == ME:
            self.kept.append(payload)
        super().send(agent, payload)


def told(mission: Mission) -> tuple[Welcome, list[Tick]]:
    """What drone `ME` is told in a flight."""
    swarm = Listening(mission)
    WorldServer(mission, swarm, "lockstep", swarm).run()
    said = [messages.unpack_from_world(message) for message in swarm.kept]
    (welcome,) = (message for message in said if isinstance(message, Welcome))
    return welcome, [message for message in said if isinstance(message, Tick)]


def spoilt(tick: Tick) -> Tick:
    """This tick with a frame that nobody may believe among those that are heard."""
    sensed = tick.data[messages.TICK_HEAD.size : tick.heard_at]
    sources, frames = (
        [1, *(source for source, _ in tick.frames())],
        [b"x", *(frame for _, frame in tick.frames())],
    )
    return make_tick(
        tick.tick, tick.proof, tick.followed, (sensed[:32], sensed[32 : 32 + 40 * tick.near], sensed[32 + 40 * tick.near :]),
        sources, frames,
    )  # fmt: skip


@pytest.mark.parametrize("policy", ["analytic", "rsc-h20", "rsc-h1", "cruise"])
def test_a_tick_in_one_call_is_answered_as_any_other_is(policy: str) -> None:
    """In a flight in which slots are traded, accounts are told, and some of what is heard is not to be believed."""
    mission = parse_mission({"agents": 6, "start": {"scrambled": True}, "seed": 6, "policy": policy})
    welcome, ticks = told(mission)
    assert len(ticks) == TICKS
    one, other = Hosted(mission, ME, welcome), Hosted(mission, ME, welcome)
    other.quick = lambda message: None
    at_once = 0
    for number, tick in enumerate(ticks):
        asked = spoilt(tick) if number % 40 == 20 else tick
        before = one.drone._tick
        assert one.answer(asked) == other.answer(asked)
        assert one.drone.tick == other.drone.tick == tick.tick
        at_once += one.drone._tick == before
    assert one.drone.rejected == other.drone.rejected
    assert one.world.commands.on_time[0] == other.world.commands.on_time[0]
    assert one.drone.rejected["malformed"] == 4
    assert at_once == 0 if policy == "cruise" else at_once > TICKS / 2


def test_a_tick_that_is_cut_off_is_not_answered_at_once() -> None:
    mission = parse_mission({"agents": 6, "policy": "analytic"})
    one = Hosted(mission, ME, Welcome(0, mission.briefing(), bytes(range(6)), 0, bytes(8), b"", False))
    sensed = SensedPacker(empty_sensed(1)).pack(0)
    one.answer(make_tick(1, 0, 0, sensed))
    whole = make_tick(2, 0, 1, sensed, [1], [b"frame"]).data
    for size in range(len(whole)):
        assert one.quick(whole[:size]) is None
    assert one.quick(make_tick(2, 0, 1, sensed).data) is not None


@pytest.mark.parametrize(("tick", "followed"), [(7, 6), (8, 6), (8, -1)], ids=["flown", "late", "never"])
def test_what_is_rare_is_not_done_at_once(tick: int, followed: int) -> None:
    mission = parse_mission({"agents": 6, "policy": "analytic"})
    one = Hosted(mission, ME, Welcome(0, mission.briefing(), bytes(range(6)), 0, bytes(8), b"", False))
    sensed = SensedPacker(empty_sensed(1)).pack(0)
    assert one.quick(make_tick(6, 0, 5, sensed).data) is None, "the first"
    one.answer(make_tick(6, 0, 5, sensed))
    one.answer(make_tick(7, 0, 6, sensed))
    assert one.quick(make_tick(tick, 0, followed, sensed).data) is None
    assert one.quick(b"R" + make_tick(8, 0, 7, sensed).data[1:]) is None
    assert one.quick(make_tick(8, 0, 7, sensed).data) is not None
