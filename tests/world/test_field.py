"""The field: obstacles from the map seed, start places and slots from the start seed."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocols.mission.document import Mission, parse_mission
from world.field import FieldError, draw_obstacles, draw_slots, draw_start


def mission(**fields: Any) -> Mission:
    return parse_mission(fields)


@given(map_seed=st.integers(0, 2**32 - 1))
def test_three_to_six_discs_lie_in_their_region(map_seed: int) -> None:
    discs = draw_obstacles(mission(map_seed=map_seed))
    assert 3 <= len(discs) <= 6
    assert ((discs[:, 0] >= 15) & (discs[:, 0] <= 35)).all()
    assert ((discs[:, 1] >= -15) & (discs[:, 1] <= 15)).all()
    assert ((discs[:, 2] >= 1) & (discs[:, 2] <= 2)).all()


def test_every_count_of_discs_comes_up_about_as_often() -> None:
    counts = np.bincount([len(draw_obstacles(mission(map_seed=seed))) for seed in range(800)], minlength=7)
    assert counts[:3].sum() == 0
    # 200 +- 12.2 each: five standard deviations.
    assert abs(counts[3:] - 200).max() < 62


def test_the_map_seed_alone_decides_the_obstacles() -> None:
    assert (
        draw_obstacles(mission(map_seed=5, seed=1)).tolist()
        == draw_obstacles(mission(map_seed=5, seed=2)).tolist()
    )
    assert draw_obstacles(mission(map_seed=5)).tolist() != draw_obstacles(mission(map_seed=6)).tolist()


def test_discs_given_in_the_mission_are_taken_as_they_are() -> None:
    discs = draw_obstacles(mission(obstacles={"discs": [[20, -1, 1.5], [25, 3, 2]]}))
    assert discs.tolist() == [[20, -1, 1.5], [25, 3, 2]]
    assert draw_obstacles(mission(obstacles={"discs": []})).shape == (0, 3)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), map_seed=st.integers(0, 2**32 - 1))
def test_everyone_starts_near_its_pad_and_clear_of_everything(seed: int, map_seed: int) -> None:
    task = mission(seed=seed, map_seed=map_seed)
    discs = draw_obstacles(task)
    places = draw_start(task, discs)
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)
    np.fill_diagonal(gaps, np.inf)
    assert gaps.min() >= 1.0
    assert (np.linalg.norm(places[:, None] - discs[None, :, :2], axis=2) - discs[:, 2]).min() >= 1.0
    assert np.linalg.norm(places - task.layout.offsets, axis=1).max() <= 5.0


def test_start_places_fill_the_disc_evenly() -> None:
    alone = [mission(agents=1, obstacles={"discs": []}, seed=seed) for seed in range(1000)]
    radius = np.array([np.linalg.norm(draw_start(task, draw_obstacles(task))[0]) for task in alone])
    # Half of the disc's area lies within 5 / sqrt(2) m: 500 +- 16.
    assert abs(np.sum(radius < 5 / np.sqrt(2)) - 500) < 80


def test_the_start_seed_decides_the_start_and_not_the_map() -> None:
    discs = np.empty((0, 3))
    assert (
        draw_start(mission(seed=1, map_seed=1), discs).tolist()
        == draw_start(mission(seed=1, map_seed=2), discs).tolist()
    )
    assert draw_start(mission(seed=1), discs).tolist() != draw_start(mission(seed=2), discs).tolist()


def test_slots_go_by_number_unless_the_start_is_scrambled() -> None:
    assert draw_slots(mission()).tolist() == list(range(25))
    scrambled = draw_slots(mission(start={"scrambled": True}, seed=3)).tolist()
    assert sorted(scrambled) == list(range(25))
    assert scrambled != list(range(25))
    assert scrambled != draw_slots(mission(start={"scrambled": True}, seed=4)).tolist()


def test_a_start_without_room_says_what_to_change() -> None:
    task = mission(agents=4, start={"radius_m": 0, "gap_m": 6})
    with pytest.raises(
        FieldError, match=r"agent 1 finds no free place within start.radius_m = 0 m .* lower start.gap_m"
    ):
        draw_start(task, np.empty((0, 3)))
