"""A drone's process: bad frames are counted and change nothing, and it leaves when it should."""

from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent import process
from agent import tick as cycle
from agent.body.relayed import Ending
from agent.process import fly
from protocols.mission.document import parse_mission
from protocols.wire import messages
from protocols.wire.frames import FIXED, MAX_FRAME_BYTES, REASONS, VERSION, altered, swarm_tag
from protocols.wire.keys import LinkError
from protocols.wire.messages import (
    Bye,
    Farewell,
    FromWorld,
    Hello,
    Ready,
    Refused,
    Reply,
    Tick,
    Wait,
    Welcome,
    make_tick,
)
from protocols.wire.sensed import SensedPacker, empty_sensed
from rsc_swarm.flight.simulate import Simulation
from tests import loopback
from tests.loopback import Hosted

MISSION = parse_mission({"agents": 6})
ME = 2
WELCOME = Welcome(0, MISSION.briefing(), bytes(range(6)), 0, bytes(8), b"")
POLICY = "rsc-h20"


def sensed() -> Any:
    rows = empty_sensed(1)
    rows.position[0], rows.velocity[0] = [1, 2], [3, 0.5]
    rows.near_count[0], rows.near[0, 0] = 1, (0, 3, 1, 0, 0)
    return SensedPacker(rows).pack(0)


def drone() -> Hosted:
    return Hosted(MISSION, ME, WELCOME)


def frames_of_a_flight(ticks: int = 30) -> list[bytes]:
    """What the others say in tick ``ticks`` - 1 of a real flight, in which slots are being traded."""
    simulation = Simulation([parse_mission({"agents": 6, "start": {"scrambled": True}, "seed": 6})])
    for _ in range(ticks):
        simulation.tick()
    first = (simulation.clock - 1) % simulation.world.ring * 6
    air = simulation._air
    return [air.pack(row) for row in range(first, first + 6) if air.frames.sender[row] != ME]


GOOD = frames_of_a_flight()
NOW = 30


def from_others(heard: list[bytes]) -> tuple[list[int], list[bytes]]:
    """The frames, and from whom they come: whom they name, or drone 1 where they name nobody."""
    place = FIXED.fields["sender"][1]
    return [data[place] if len(data) > FIXED.itemsize else 1 for data in heard], heard


def ticked(tick: int, heard: list[bytes]) -> Tick:
    return make_tick(tick, 0, tick - 1, sensed(), *from_others(heard))


def reply(answer: bytes) -> Reply:
    said = messages.unpack_from_drone(answer, 6)
    assert isinstance(said, Reply)
    return said


def answers(heard: list[bytes], ticks: int = 3) -> tuple[list[Reply], dict[str, int]]:
    """A drone's answers to some ticks in a row, without its account of itself; what it has rejected."""
    one, times = drone(), range(NOW, NOW + ticks)
    said = [one.answer(ticked(tick, heard if tick == NOW else [])) for tick in times]
    return [reply(answer)._replace(status=None) for answer in said], one.drone.rejected


DEAF = answers([])[0]


def test_a_frame_in_anothers_name_is_dropped() -> None:
    sources, heard = from_others(GOOD)
    one = drone()
    one.answer(make_tick(NOW, 0, NOW - 1, sensed(), [source + 1 for source in sources], heard))
    assert one.drone.rejected["sender"] == len(heard)


def noted(note: object, data: bytes = GOOD[0]) -> bytes:
    """A frame that says this of slots."""
    return altered(data, note=msgpack.packb(note))


def patched(name: str, value: Any, data: bytes = GOOD[0]) -> bytes:
    """A frame of which one field of the record is replaced."""
    record = np.frombuffer(data, FIXED, 1).copy()
    record[name] = value
    return record.tobytes() + data[FIXED.itemsize :]


def rejected(**counts: int) -> dict[str, int]:
    return {**dict.fromkeys(REASONS, 0), **counts}


def test_good_frames_are_believed() -> None:
    said, counts = answers(GOOD)
    assert said != DEAF
    assert counts == rejected()


def nested(deep: int) -> list[Any]:
    """[[[...]]], so deep that Python's own way to print it gives up."""
    return [nested(deep - 1)] if deep else []


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "malformed"),
        (b"\xc1 no frame", "malformed"),
        (bytes(MAX_FRAME_BYTES + 1), "oversized"),
        (patched("version", VERSION + 1), "version"),
        (patched("tag", swarm_tag("other")), "foreign"),
        (GOOD[0][: FIXED.itemsize + 1], "malformed"),
        (patched("loud", 1, altered(GOOD[0], note=b"")), "malformed"),
        (altered(GOOD[0], note=b"\xc1"), "malformed"),
        (noted(None), "malformed"),
        (noted([1]), "malformed"),
        (noted([-1, 1]), "malformed"),
        (noted([1, 2]), "malformed"),
        (noted(nested(900)), "malformed"),
        (noted([nested(900), 1]), "malformed"),
        (noted([1, 1, 0, [0, 1, 2, 2], None, [], None, [], [], None]), "malformed"),
        (noted([1, 1, 0, None, None, [], None, [], [], [bytes(6), 1, 1, 1]]), "malformed"),
        (patched("motion", (np.nan, 0, 0, 0)), "non-finite"),
        (patched("sender", ME), "sender"),
    ],
)
def test_a_bad_frame_is_counted_by_its_reason_and_as_good_as_unheard(data: bytes, reason: str) -> None:
    assert answers([data]) == (DEAF, rejected(**{reason: 1}))


@pytest.mark.parametrize("error", [RecursionError, MemoryError, KeyError, OverflowError])
def test_whatever_reading_one_frame_ends_in_costs_that_frame_alone(
    monkeypatch: pytest.MonkeyPatch, error: type[Exception]
) -> None:
    def fail(encoded: object, agents: int) -> None:
        raise error

    monkeypatch.setattr("agent.radio.air.decode", fail)
    loud = noted([1, 0])
    assert answers([loud]) == (DEAF, rejected(malformed=1))


def test_a_frame_from_the_past_or_the_future_is_stale() -> None:
    late = drone()
    late.answer(ticked(NOW + 500, GOOD))
    early = drone()
    early.answer(ticked(NOW - 1, GOOD))
    assert late.drone.rejected == early.drone.rejected == rejected(stale=5)


def test_bad_frames_between_good_ones_take_nothing_from_them() -> None:
    mixed = [b"", GOOD[0], noted(None), GOOD[1], bytes(2000), *GOOD[2:], patched("sender", ME)]
    said, counts = answers(mixed)
    assert said == answers(GOOD)[0]
    assert counts == rejected(malformed=2, oversized=1, sender=1)


@given(garbage=st.lists(st.binary(max_size=1100), max_size=8))
def test_random_bytes_leave_a_drone_as_it_was(garbage: list[bytes]) -> None:
    said, counts = answers(garbage)
    assert said == DEAF
    assert sum(counts.values()) == len(garbage)


NUMBERS = st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats()
ANYTHING = st.recursive(
    NUMBERS | st.binary(max_size=60) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=11),
    max_leaves=15,
)  # fmt: skip


@settings(max_examples=200)
@given(which=st.integers(0, len(GOOD) - 1), value=ANYTHING)
def test_a_good_frame_with_any_note_is_no_crash(which: int, value: Any) -> None:
    said, counts = answers([noted(value, GOOD[which])])
    assert sum(counts.values()) == 0 or said == DEAF


@settings(max_examples=200)
@given(which=st.integers(0, len(GOOD) - 1), at=st.integers(0, 4000), flip=st.integers(1, 255))
def test_a_good_frame_with_one_byte_changed_is_believed_or_as_good_as_unheard(
    which: int, at: int, flip: int
) -> None:
    data = bytearray(GOOD[which])
    data[at % len(data)] ^= flip
    said, counts = answers([bytes(data)])
    assert sum(counts.values()) == 0 or said == DEAF
    assert all(np.isfinite(answer.ax) for answer in said)


NOTES = st.tuples(
    st.integers(0, 2**64 - 1), st.integers(0, 1), st.integers(0, 1),
    st.none() | st.lists(st.integers(0, 6), min_size=4, max_size=4),
    st.none() | st.lists(st.integers(0, 6), min_size=3, max_size=3),
    st.lists(st.lists(st.integers(0, 6), min_size=2, max_size=2), max_size=3),
    st.none() | st.lists(st.integers(0, 6), min_size=2, max_size=2),
    st.lists(st.lists(st.integers(0, 5), min_size=7, max_size=7), max_size=4),
    st.lists(st.lists(st.integers(0, 5), min_size=5, max_size=5), max_size=4),
    st.none() | st.permutations(range(6)).map(lambda view: [bytes(view), 5, 3, 2]),
)  # fmt: skip


@settings(max_examples=200)
@given(notes=st.lists(NOTES, min_size=1, max_size=5))
def test_whatever_neighbours_say_about_slots_a_drone_goes_on_and_holds_one(notes: list[Any]) -> None:
    one = drone()
    heard = [noted(note, frame) for note, frame in zip(notes, GOOD, strict=False)]
    one.answer(ticked(NOW, heard))
    assert 0 <= reply(one.answer(ticked(NOW + 1, []))).slot < 6
    assert sorted(one.drone.status().view) == list(range(6))


def test_a_steady_formation_of_twenty_five_speaks_in_at_most_250_bytes() -> None:
    steady = parse_mission({"start": {"radius_m": 0}, "obstacles": {"discs": []}, "fly_s": 1.5})
    assert loopback.fly(steady).median_frame_bytes <= 250


def test_a_drone_that_begins_in_mid_flight_takes_nobody_for_dead() -> None:
    one = Hosted(MISSION, ME, WELCOME._replace(boot=1))
    one.answer(ticked(900, []))
    assert one.drone._core._memory.last_seen[0].tolist() == [900] * 6


class Script:
    """A link on which the world says these messages one after the other, and then nothing; it welcomes whoever says Hello."""

    def __init__(self, *said: FromWorld) -> None:
        self.said, self.heard, self.process = list(said), [], 0

    def receive(self, timeout_s: float) -> bytes | None:
        if not self.said or timeout_s == 0.0:
            return None
        message = self.said.pop(0)
        if message == WELCOME:
            message = WELCOME._replace(process=self.process)
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


def test_after_the_rehearsal_a_drone_that_swaps_compiles_nothing() -> None:
    process.rehearse(MISSION)
    ready = {
        name: len(getattr(cycle, name).signatures) for name in ("before_policy", "aim_again", "after_policy")
    }
    assert all(ready.values())
    one = drone()
    for tick in range(NOW, NOW + 3):
        one.answer(ticked(tick, GOOD if tick == NOW else []))
    assert ready == {name: len(getattr(cycle, name).signatures) for name in ready}
