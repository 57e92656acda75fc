"""The flood: what could be known, over the frames that arrived."""

import numpy as np

from world.flood import NEVER, Flood, empty_flood, spread


def step(flood: Flood, tick: int, *arrivals: tuple[int, int, int]) -> None:
    """One tick of three drones; an arrival is (listener, speaker, tick of sending)."""
    counts = [sum(arrival[0] == row for arrival in arrivals) for row in range(3)]
    frames = np.array([arrival[1:] for arrival in sorted(arrivals)], np.int32).reshape(-1, 2)
    start = np.concatenate([[0], np.cumsum(counts)])
    spread(flood, np.array([tick]), np.ones(1, np.bool_), start, frames)


def test_news_go_one_hop_with_each_frame_that_arrives() -> None:
    flood = empty_flood(1, 3, ring=4)
    step(flood, 0)
    step(flood, 1, (1, 0, 0))
    step(flood, 2, (2, 1, 1))
    assert flood.latest[0].tolist() == [[2, NEVER, NEVER], [0, 2, NEVER], [0, 1, 2]]


def test_a_late_frame_tells_what_its_sender_knew_when_it_sent_it() -> None:
    flood = empty_flood(1, 3, ring=4)
    for tick in range(3):
        step(flood, tick)
    step(flood, 3, (1, 0, 1))
    assert flood.latest[0, 1].tolist() == [1, 3, NEVER]
