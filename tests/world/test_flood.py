"""The information_bound: what could be known, over the frames that arrived."""

import numpy as np

from world.medium.information_bound import NEVER, InformationBound, empty_information_bound, spread


def step(information_bound: InformationBound, tick: int, *arrivals: tuple[int, int, int]) -> None:
    """One tick of three drones; an arrival is (listener, speaker, tick of sending)."""
    counts = [sum(arrival[0] == row for arrival in arrivals) for row in range(3)]
    frames = np.array([arrival[1:] for arrival in sorted(arrivals)], np.int32).reshape(-1, 2)
    start = np.concatenate([[0], np.cumsum(counts)])
    spread(information_bound, np.array([tick]), np.ones(1, np.bool_), start, frames)


def test_news_go_one_hop_with_each_frame_that_arrives() -> None:
    information_bound = empty_information_bound(1, 3, ring=4)
    step(information_bound, 0)
    step(information_bound, 1, (1, 0, 0))
    step(information_bound, 2, (2, 1, 1))
    assert information_bound.latest[0].tolist() == [[2, NEVER, NEVER], [0, 2, NEVER], [0, 1, 2]]


def test_a_late_frame_tells_what_its_sender_knew_when_it_sent_it() -> None:
    information_bound = empty_information_bound(1, 3, ring=4)
    for tick in range(3):
        step(information_bound, tick)
    step(information_bound, 3, (1, 0, 1))
    assert information_bound.latest[0, 1].tolist() == [1, 3, NEVER]
