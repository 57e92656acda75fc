"""Perception: what a drone makes of its sensors and of the frames it hears, and what it tells others."""

import numpy as np
import pytest

from agent.heard import find_heard, take_word
from agent.memory import Memory, empty_memory, forget
from agent.perceive import compose_row, find_sensed, hear_frame, recall_obstacles
from agent.rules import rules_of
from agent.tick_arrays import TickArrays
from protocols.mission.document import parse_mission
from protocols.relative import NEVER, UNKNOWN, RadioRules
from protocols.wire.frames import AGE_NEVER, OBSERVATION_UNIT, Frames, empty_frames
from protocols.wire.sensed import empty_sensed
from tests.hops import within
from tests.parts import empty_parts

N = 10
RADIO = RadioRules(range_m=6.0, memory_ticks=30, max_hops=3, speed_mps=10.0)
RULES = rules_of(parse_mission({"agents": N}))._replace(radio=RADIO)


def frame(sender: int = 3, tick: int = 500, **fields: object) -> Frames:
    frames = empty_frames(1)
    frames.fixed[0]["ages"] = AGE_NEVER
    for name, value in {"sender": sender, "tick": tick, **fields}.items():
        frames.fixed[0][name] = value
    return frames


def heard(*frames: Frames) -> Memory:
    memory = empty_memory(1, N)
    for one in frames:
        hear_frame(memory, 0, one, 0, RADIO)
    for one in frames:
        take_word(memory, 0, 0, int(one.sender[0]), int(one.tick[0]), RULES)
    return memory


def test_what_a_frame_says_is_kept() -> None:
    said = frame(motion=(1, 2, 3, 4), observation=np.arange(18), one_hop=1, known_count=2)
    said.known[0, :2], said.displacement[0, :2] = [7, 8], [(1.5, 0), (3.0, 0.5)]
    memory = heard(said)
    assert memory.heard_tick[0].tolist() == [NEVER] * 3 + [500] + [NEVER] * 6
    assert memory.heard_motion[0, 3].tolist() == [1, 2, 3, 4]
    assert memory.heard_observation[0, 3].tolist() == list(range(18))
    assert (memory.heard_one_hop[0, 3], memory.heard_count[0, 3]) == (1, 2)
    assert memory.heard_known[0, 3, :2].tolist() == [7, 8]
    assert memory.heard_displacement[0, 3, :2].tolist() == [[1.5, 0], [3.0, 0.5]]


def test_an_older_frame_that_comes_later_changes_nothing() -> None:
    memory = heard(frame(tick=500, motion=(1, 0, 0, 0)), frame(tick=499, motion=(9, 9, 9, 9)))
    assert memory.heard_tick[0, 3] == 500
    assert memory.heard_motion[0, 3, 0] == 1.0


def test_a_duplicate_changes_nothing() -> None:
    once, twice = (
        heard(frame(motion=(1, 2, 3, 4))),
        heard(frame(motion=(1, 2, 3, 4)), frame(motion=(1, 2, 3, 4))),
    )
    assert all(np.array_equal(a, b) for a, b in zip(once, twice, strict=True))


def test_whom_a_sender_has_heard_lately_lives() -> None:
    # Ages of drones 8, 9, 0, 1, ...: in tenths of a second before the frame's tick.
    memory = heard(
        frame(tick=500, age_from=8, ages=(2, AGE_NEVER, 0, 30, AGE_NEVER, AGE_NEVER, AGE_NEVER, AGE_NEVER))
    )
    assert memory.last_seen[0].tolist() == [500, 200, 0, 500, 0, 0, 0, 0, 480, 0]


def test_a_sender_that_knows_less_makes_nobody_older() -> None:
    fresh = frame(sender=4, tick=500, age_from=8, ages=(0,) + (AGE_NEVER,) * 7)
    assert heard(fresh, frame(tick=500, age_from=8, ages=(90,) + (AGE_NEVER,) * 7)).last_seen[0, 8] == 500


def test_what_is_not_sensed_is_found_from_frames_moved_on_by_their_velocity() -> None:
    memory = heard(
        frame(sender=3, tick=490, motion=(10, 0, 2, -1)), frame(sender=5, tick=460, motion=(11, 1, 0, 0))
    )
    sensed = empty_sensed(1)
    sensed.position[0], sensed.velocity[0] = [8.0, 1.0], [1.0, 0.0]
    find_heard(memory, 0, 0, 500, sensed, RADIO, 10.0)
    # Drone 3 was at (10, 0) a tenth of a second ago; drone 5's frame is older than it is believed.
    assert memory.near_count[0] == 1
    assert memory.near_id[0, 0] == 3
    assert memory.near_rel[0, 0].tolist() == pytest.approx([2.2, -1.1])
    assert memory.near_vel[0, 0].tolist() == [1.0, -1.0]


def test_a_frame_is_believed_to_the_last_tick_of_its_time() -> None:
    memory = heard(frame(sender=3, tick=470), frame(sender=4, tick=469))
    find_heard(memory, 0, 0, 500, empty_sensed(1), RADIO, 10.0)
    assert memory.near_id[0, : memory.near_count[0]].tolist() == [3]


def test_one_heard_from_beyond_the_range_is_no_neighbour() -> None:
    memory = heard(
        frame(sender=3, tick=500, motion=(6.1, 0, 0, 0)), frame(sender=4, tick=500, motion=(0, 6.0, 0, 0))
    )
    find_heard(memory, 0, 0, 500, empty_sensed(1), RADIO, 10.0)
    assert memory.near_id[0, : memory.near_count[0]].tolist() == [4]


def test_what_is_sensed_counts_alone_where_there_are_sensors() -> None:
    memory, sensed = heard(frame(sender=3, tick=500, motion=(1, 0, 0, 0))), empty_sensed(1)
    sensed.near_count[0], sensed.near[0, 0] = 1, (7, 1, 2, 3, 4)
    find_sensed(memory, 0, sensed)
    assert memory.near_id[0, : memory.near_count[0]].tolist() == [7]
    assert memory.near_rel[0, 0].tolist() == [1, 2]


def see_discs(memory: Memory, x: float, *discs: tuple[float, float, float], remember: bool = True) -> None:
    """The drone is at (x, 0) and sees these discs, given by their centres on the map."""
    sensed = empty_sensed(1)
    sensed.position[0, 0] = x
    for index, (cx, cy, radius) in enumerate(discs):
        sensed.obstacles[0, index] = (cx - x, cy, radius)
    sensed.obstacle_count[0] = len(discs)
    recall_obstacles(memory, 0, sensed, remember)


def test_an_obstacle_out_of_sight_is_remembered_where_it_stands() -> None:
    memory = empty_memory(1, N)
    see_discs(memory, 0.0, (5.0, 1.0, 1.5))
    memory.disc_side[0, 0] = -1
    see_discs(memory, 9.0)
    assert memory.disc_count[0] == 1
    assert memory.obstacle_rel[0, 0].tolist() == [-4.0, 1.0]
    assert (memory.obstacle_radius[0, 0], memory.disc_side[0, 0]) == (1.5, -1)


def test_without_memory_what_is_out_of_sight_is_gone_and_the_rest_keep_their_sides() -> None:
    memory = empty_memory(1, N)
    see_discs(memory, 0.0, (5.0, 1.0, 1.5), (5.0, -4.0, 1.0), remember=False)
    memory.disc_side[0, :2] = [1, -1]
    see_discs(memory, 2.0, (5.0, -4.0, 1.0), remember=False)
    assert memory.disc_count[0] == 1
    assert (memory.disc[0, 0].tolist(), memory.disc_side[0, 0]) == ([5.0, -4.0, 1.0], -1)


def test_on_which_side_an_obstacle_was_passed_says_nothing_of_the_next_one() -> None:
    memory = empty_memory(1, N)
    see_discs(memory, 0.0, (5.0, 1.0, 1.5), remember=False)
    memory.disc_side[0, 0] = 1
    see_discs(memory, 20.0, remember=False)
    see_discs(memory, 20.0, (25.0, -1.0, 1.5), remember=False)
    assert (memory.disc_count[0], memory.disc_side[0, 0]) == (1, 0)


def test_the_same_obstacle_seen_again_is_one_obstacle() -> None:
    memory = empty_memory(1, N)
    for step in range(20):
        see_discs(memory, 0.1 * step, (5.0, 1.0, 1.5), (5.0, 4.0, 1.5))
    assert memory.disc_count[0] == 2


def test_two_obstacles_that_nearly_coincide_are_two() -> None:
    memory = empty_memory(1, 4)
    see_discs(memory, 5.0, (8.0, 0.0, 1.75), (8.02, 0.03, 1.0))
    see_discs(memory, 5.5, (8.0, 0.0, 1.75), (8.02, 0.03, 1.0))
    assert memory.obstacle_radius[0, : memory.disc_count[0]].tolist() == [1.75, 1.0]


def test_more_obstacles_than_can_be_remembered_are_no_crash() -> None:
    memory = empty_memory(1, N)
    for batch in range(3):
        see_discs(memory, 0.0, *((3.0 * index, 20.0 * batch, 1.0) for index in range(10)))
    assert memory.disc_count[0] == 16


def drone(memory: Memory | None = None, me: int = 2, max_hops: int = 3) -> TickArrays:
    """Drone ``me``."""
    return empty_parts(parse_mission({"agents": N, "radio": {"hops": max_hops}}), me, memory)


def compose(tick: int, parts: TickArrays) -> None:
    compose_row(tick, 0, 0, parts.rules, parts.work, parts.sensed, parts.frames, parts.memory)


def composed(hops: dict[int, int], tick: int = 512, max_hops: int = 3, me: int = 2) -> Frames:
    """What drone ``me`` tells at ``tick``, knowing others over so many hops."""
    parts = drone(me=me, max_hops=max_hops)
    memory, sensed, work = parts.memory, parts.sensed, parts.work
    memory.hops[0] = UNKNOWN
    for other, distance in hops.items():
        memory.hops[0, other], memory.rel[0, other] = distance, [other, -other]
    known = within(memory.hops[0])
    memory.within[0, : len(known.number)], memory.within_up_to[0] = known
    memory.last_seen[0] = np.arange(N) * 10 + tick - 100
    sensed.position[0], sensed.velocity[0] = [1.5, 2.5], [3.5, 4.5]
    work.observation[0, :3] = [0.5, -20.0, 20.0]
    compose(tick, parts)
    return parts.frames


def test_a_frame_tells_who_where_and_what_is_observed() -> None:
    frames = composed({})
    assert (frames.sender[0], frames.tick[0], frames.known_count[0]) == (2, 512, 0)
    assert frames.motion[0].tolist() == [1.5, 2.5, 3.5, 4.5]
    # What does not fit is cut off at the end of the scale, not wrapped around it.
    assert frames.observation[0, :3].tolist() == [0.5 * OBSERVATION_UNIT, -32767, 32767]


def test_a_frame_tells_neighbours_first_then_theirs_and_nothing_farther() -> None:
    frames = composed({2: 0, 9: 1, 4: 2, 1: 1, 6: 3})
    assert (frames.one_hop[0], frames.known_count[0]) == (2, 3)
    assert frames.known[0, :3].tolist() == [1, 9, 4]
    assert frames.displacement[0, :3].tolist() == [[1, -1], [9, -9], [4, -4]]


@pytest.mark.parametrize(("max_hops", "known"), [(3, [1, 4]), (2, [1]), (1, [])])
def test_a_frame_tells_no_more_than_the_last_hop_needs(max_hops: int, known: list[int]) -> None:
    frames = composed({1: 1, 4: 2}, max_hops=max_hops)
    assert frames.known[0, : frames.known_count[0]].tolist() == known


def test_ages_are_told_in_turn_over_all_drones() -> None:
    # The window of eight moves on by eight each tick. Drone i was seen 100 - 10 i ticks ago.
    told = {
        tick: (int(frames.age_from[0]), frames.ages[0].tolist())
        for tick in range(510, 513)
        if (frames := composed({}, tick))
    }
    assert told[510] == (0, [10, 9, 8, 7, 6, 5, 4, 3])
    assert told[511] == (8, [2, 1, 10, 9, 8, 7, 6, 5])
    assert told[512] == (6, [4, 3, 2, 1, 10, 9, 8, 7])


def told_age(ticks_ago: int) -> int:
    parts = drone()
    parts.memory.last_seen[0] = 5000 - ticks_ago
    compose(5000, parts)
    return int(parts.frames.ages[0, 0])


@pytest.mark.parametrize(
    ("ticks_ago", "age"),
    [(0, 0), (1, 1), (10, 1), (11, 2), (2540, 254), (2541, AGE_NEVER), (5000, AGE_NEVER)],
)
def test_an_age_is_told_in_tenths_of_a_second_rounded_up(ticks_ago: int, age: int) -> None:
    assert told_age(ticks_ago) == age


def test_a_rumour_never_makes_a_silent_drone_younger() -> None:
    """Passed on tick after tick, an age grows at least as fast as time."""
    memory = empty_memory(1, N)
    memory.last_seen[0, 5] = 100
    for tick in range(101, 400):
        parts = drone(memory)
        compose(tick, parts)
        hear_frame(memory, 0, parts.frames, 0, RADIO)
        assert memory.last_seen[0, 5] == 100


def test_one_that_forgets_takes_nobody_for_dead() -> None:
    memory = heard(frame(tick=500))
    see_discs(memory, 0.0, (5.0, 1.0, 1.5))
    forget(memory, 0, 600)
    assert memory.heard_tick[0].tolist() == [NEVER] * N
    assert memory.last_seen[0].tolist() == [600] * N
    assert memory.disc_count[0] == 0


def test_who_says_it_moved_as_no_drone_can_is_not_believed() -> None:
    """The limit of the mission is 10 m/s: in 10 ms nobody gets further than 0.1 m, and half a metre is forgiven."""
    honest = frame(tick=500, motion=(1, 2, 3, 4))
    assert heard(frame(tick=500, motion=(1, 2, 10.2, 0))).heard_tick[0, 3] == NEVER
    for lie in ((1, 2, 1e30, 0), (1, 2, 0, -11), (3, 2, 0, 0), (1, -3e38, 0, 0)):
        memory = heard(honest, frame(tick=501, motion=lie))
        assert (memory.heard_tick[0, 3], memory.heard_motion[0, 3].tolist()) == (500, [1, 2, 3, 4])
    for truth in ((1.1, 2, 0, -10), (1, 2.55, 3, 4)):
        assert heard(honest, frame(tick=501, motion=truth)).heard_tick[0, 3] == 501
    assert heard(honest, frame(tick=531, motion=(99, 99, 0, 0))).heard_tick[0, 3] == 531, "forgotten by then"
