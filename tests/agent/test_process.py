"""A drone's process: it says hello, answers each tick once, and leaves when it should."""

import subprocess
import sys

import pytest

from agent.body.relayed import Ending
from agent.process import fly
from protocols.wire import messages
from protocols.wire.keys import LinkError
from protocols.wire.messages import (
    Bye,
    Farewell,
    FromWorld,
    Hello,
    Ready,
    Refused,
    Reply,
    Wait,
    Welcome,
    make_tick,
)
from tests.agent.drones import GOOD, ME, NOW, POLICY, WELCOME, drone, reply, sensed, ticked


class Script:
    """A link on which the world says these messages one after the other, and then nothing; it welcomes whoever says Hello."""

    def __init__(self, *said: FromWorld) -> None:
        self.said, self.heard, self.process = list(said), [], 0

    def receive(self, timeout_s: float) -> bytes | None:
        if not self.said or timeout_s == 0.0:
            return None
        message = self.said.pop(0)
        if isinstance(message, Welcome) and message.process == WELCOME.process:
            message = message._replace(process=self.process)
        return messages.pack(message)

    def use_datagrams(self, key: bytes) -> None:
        raise AssertionError("none were offered")

    def cast(self, payload: bytes) -> bool:
        return False

    def send(self, payload: bytes) -> None:
        self.heard.append(messages.unpack_from_drone(payload, 6))
        if isinstance(self.heard[-1], Hello):
            self.process = self.heard[-1].process

    @property
    def kinds(self) -> list[type]:
        return [type(message) for message in self.heard]

    @property
    def answered(self) -> list[int]:
        return [message.tick for message in self.heard if isinstance(message, Reply)]


def test_a_drone_says_hello_flies_and_takes_its_leave() -> None:
    world = Script(WELCOME, ticked(0, []), Wait(), ticked(1, []), Bye())
    assert fly(world, ME, POLICY, lambda: False) is Ending.OVER
    assert world.kinds == [Hello, Ready, Reply, Ready, Reply, Farewell]
    assert world.answered == [0, 1]
    assert {message.process for message in world.heard} == {world.process}


@pytest.mark.parametrize("slots", [b"", bytes(5), bytes(6), bytes(range(7)), bytes(range(1, 7))])
def test_a_world_that_gives_no_slot_to_each_drone_is_refused(slots: bytes) -> None:
    with pytest.raises(LinkError, match="the world welcomes drone 2 to a swarm of 6 drones"):
        fly(Script(WELCOME._replace(initial_slots=slots)), ME, POLICY, lambda: False)


def test_a_world_whose_mission_a_drone_is_not_in_is_refused() -> None:
    with pytest.raises(LinkError, match="the world welcomes drone 6 to a swarm of 6 drones"):
        fly(Script(WELCOME), 6, POLICY, lambda: False)


def test_a_drone_repeats_its_hello_until_it_is_welcomed_and_leaves_a_silent_world() -> None:
    world = Script()
    assert fly(world, ME, POLICY, lambda: False) is Ending.WORLD_SILENT
    assert world.kinds == [Hello] * len(world.heard)
    assert len(world.heard) > 3


def test_a_world_that_only_says_wait_is_not_silent() -> None:
    world = Script(*[Wait()] * 500, Bye())
    assert fly(world, ME, POLICY, lambda: False) is Ending.OVER


def test_a_drone_leaves_when_asked_to() -> None:
    world = Script(WELCOME, *(ticked(tick, []) for tick in range(100)))
    assert fly(world, ME, POLICY, lambda: len(world.heard) > 10) is Ending.ASKED_TO_LEAVE
    assert len(world.heard) == 11


def test_ticks_before_the_welcome_are_not_answered() -> None:
    world = Script(ticked(0, []), WELCOME, ticked(1, []), Bye())
    fly(world, ME, POLICY, lambda: False)
    assert world.answered == [1]


def test_a_drone_that_is_asked_again_answers_the_same_and_does_not_act_twice() -> None:
    world = Script(
        WELCOME, ticked(0, []), ticked(1, GOOD), ticked(1, GOOD), ticked(0, []), ticked(2, []), Bye()
    )
    fly(world, ME, POLICY, lambda: False)
    said = [message for message in world.heard if isinstance(message, Reply)]
    assert [reply.tick for reply in said] == [0, 1, 1, 2]
    assert said[1] == said[2]


def test_of_ticks_that_have_piled_up_only_the_newest_is_answered_and_no_frame_is_unheard() -> None:
    class Heap(Script):
        def receive(self, timeout_s: float) -> bytes | None:
            return super().receive(1.0)

    world = Heap(WELCOME, ticked(NOW, GOOD[:2]), ticked(NOW + 2, GOOD[2:]), ticked(NOW + 1, []))
    fly(world, ME, POLICY, lambda: False, silence_s=1.0)
    (reply,) = (message for message in world.heard if isinstance(message, Reply))
    assert reply.tick == NOW + 2
    assert reply.status is None or reply.status.heard == len(GOOD)


def test_an_account_is_told_again_until_the_world_has_followed_an_answer_that_told_it() -> None:
    """Answers get lost in real time, and the world holds a drone to what it told of itself."""
    one = drone()
    told = []
    for tick in range(8):
        followed = -1 if tick < 4 else tick - 2
        asked = make_tick(tick, 0, followed, sensed())
        told.append(reply(one.answer(asked)).status is not None)
    assert told == [True] * 4 + [False] * 4


def test_a_drone_that_hears_nothing_says_now_and_then_that_it_is_there() -> None:
    """So the world asks again what was lost, and a world that was started anew says that it does not know it."""
    world = Script(WELCOME, ticked(0, []))
    assert fly(world, ME, POLICY, lambda: False, silence_s=4.0) == Ending.WORLD_SILENT
    assert world.kinds == [Hello, Ready, Reply, Ready, Ready, Ready]


def test_a_second_welcome_does_not_make_a_drone_forget() -> None:
    world = Script(WELCOME, ticked(0, []), WELCOME, ticked(1, []), Bye())
    fly(world, ME, POLICY, lambda: False)
    assert world.kinds.count(Ready) == 1


def test_what_is_said_to_another_process_with_its_login_moves_it_not() -> None:
    world = Script(WELCOME._replace(process=7), ticked(0, []), Refused(7, "not you"), Wait(), Bye())
    assert fly(world, ME, POLICY, lambda: False) is Ending.OVER
    assert world.kinds == [Hello]


def test_a_drone_that_is_refused_leaves_and_says_why() -> None:
    class Refusing(Script):
        def receive(self, timeout_s: float) -> bytes | None:
            return messages.pack(Refused(self.process, "there is one already"))

    with pytest.raises(LinkError, match=r"^there is one already$"):
        fly(Refusing(), ME, POLICY, lambda: False)


def test_a_pause_of_its_own_is_no_silence_of_the_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long the process is stopped while it listens, that is one look that brought nothing."""
    clock = [0.0]

    class Stopped(Script):
        def receive(self, timeout_s: float) -> bytes | None:
            clock[0] += 3600.0
            return super().receive(timeout_s) if self.heard.count(self.heard[0]) > 5 else None

    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    assert fly(Stopped(Bye()), ME, POLICY, lambda: False, silence_s=2.0) is Ending.OVER


def test_a_drone_tells_of_itself_now_and_then() -> None:
    one = drone()
    told = [tick for tick in range(101) if reply(one.answer(ticked(tick, []))).status]
    assert told == [0, 50, 100]


_LOADED = """
import sys
from agent import process
from tests.agent import drones as story
from tests.loopback import Hosted

def loaded():
    rules = [rule for name, module in sys.modules.items() if name.startswith("agent.") for rule in vars(module).values()]
    return {f"{rule.__module__}.{rule.__name__}": len(rule.signatures) for rule in rules if hasattr(rule, "signatures")}

for policy in ("rsc-h20", "analytic"):
    mission = story.MISSION.model_copy(update={"policy": policy})
    process.rehearse(mission)
    before, one = loaded(), Hosted(mission, story.ME, story.WELCOME)
    for tick in range(story.NOW, story.NOW + 3):
        one.answer(story.ticked(tick, story.GOOD if tick == story.NOW else []))
    print(policy, sorted(name for name, count in loaded().items() if count != before.get(name, 0)))
"""


def test_after_the_rehearsal_a_drone_that_swaps_and_hears_loads_nothing() -> None:
    """Each process would else have it in its own memory, and be late by as long as it takes."""
    said = subprocess.run([sys.executable, "-c", _LOADED], capture_output=True, text=True, check=True).stdout
    assert said.splitlines() == ["rsc-h20 []", "analytic []"]
