"""Lies by radio are frames that others read, in the liar's own name, and say what they are to say."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from agent.radio.air import Air
from protocols.mission.fault import LieName
from protocols.slots.history import Swap, pack_swap
from protocols.slots.notes import SlotNote
from protocols.slots.seals import Sealed, Stamps
from protocols.wire.frames import parts_of
from protocols.wire.lies import LIES, Honest, says

AGENTS, ME, TICK = 6, 2, 400
OLD, NEW = range(2)


def honest_frame(digest: int) -> bytes:
    """Of a drone that knows of two others, and has a swap to tell."""
    air = Air("swarm", AGENTS, 1)
    frames = air.frames
    frames.sender[0], frames.tick[0], frames.slot[0] = ME, TICK, 1
    frames.motion[0] = 1.0, 2.0, 3.0, 4.0
    frames.ages[0] = 7
    frames.known_count[0], frames.one_hop[0] = 2, 1
    frames.known[0, :2], frames.displacement[0, :2] = (0, 5), ((1, 2), (3, 4))
    op = Swap(1, ME, 9, 2, 3, 3, taken=True)
    air.put_note(0, SlotNote(digest, settled=False, ops=(Sealed(op, Stamps(ME).seal(pack_swap(op))),)))
    return air.pack(0)


def told(name: str) -> Air:
    """What is read of this lie, of a drone that said the frame of digest `OLD` a while ago."""
    honest = Honest(
        ME, AGENTS, TICK, honest_frame(NEW), np.random.default_rng(1), Stamps(ME).seal, [honest_frame(OLD)]
    )
    air = Air("swarm", AGENTS, 1)
    air.unpack(0, LIES[name](honest))
    return air


def test_a_mission_can_ask_for_each_and_no_other() -> None:
    assert set(get_args(LieName)) == set(LIES)


@pytest.mark.parametrize("name", LIES)
def test_a_lie_is_a_whole_frame_in_the_liars_own_name(name: str) -> None:
    air, data = told(name), honest_frame(NEW)
    frames = air.frames
    assert (frames.sender[0], frames.tick[0], frames.known_count[0]) == (ME, TICK, 2)
    assert np.isfinite(frames.motion[0].astype(float)).all()
    assert air.pack(0) != data, "it is another frame"
    assert len(parts_of(air.pack(0)).fixed) == len(parts_of(data).fixed)


def test_the_documentation_says_what_each_tells() -> None:
    text = (Path(__file__).parents[2] / "docs" / "missions.md").read_text()
    assert all(f"| `{name}` | {says(name)} |" in text for name in LIES)


def test_what_they_say() -> None:
    assert told("position").frames.motion[0].tolist() == [1, 5, 3, 4]
    assert told("displacement").frames.displacement[0, :2].tolist() == [[-1, -2], [-3, -4]]
    assert told("all-alive").frames.ages[0].tolist() == [0] * 8
    assert told("digest").note(0).digest not in (OLD, NEW)
    assert told("digest").note(0).quiet
    assert told("replay").note(0).digest == told("replay").frames.digest[0] == OLD
    (forged,) = told("forged-swaps").note(0).ops
    assert not forged.holds(Stamps(0)), "nobody who looks at the seals believes it"
    assert told("forged-checkpoint").note(0).whole is not None


def test_who_has_nothing_to_lie_about_says_what_is_so() -> None:
    alone = Honest(0, 2, TICK, honest_frame(NEW), np.random.default_rng(1), Stamps(0).seal)
    assert LIES["forged-swaps"](alone) == LIES["replay"](alone) == alone.frame
