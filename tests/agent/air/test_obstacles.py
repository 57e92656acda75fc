"""What sources tell of obstacles becomes one list, in which each stands once, however often and badly it was seen."""

import random

import pytest

from agent.air.obstacles import MapSource, Obstacles, Sighting


class Told:
    """A source that has this to tell, once."""

    def __init__(self, *sightings: Sighting) -> None:
        self._sightings = sightings

    def news(self) -> tuple[Sighting, ...]:
        news, self._sightings = self._sightings, ()
        return news


def found(*sources: Told | MapSource) -> list[tuple[float, float, float]]:
    obstacles = Obstacles(sources)
    obstacles.look()
    obstacles.look()  # nothing is new
    return obstacles.discs


def test_the_map_is_taken_as_it_is() -> None:
    discs = [(0.0, 0.0, 0.1), (1.0, 0.0, 0.2)]
    assert found(MapSource(discs)) == discs


def test_what_several_sources_find_is_known() -> None:
    assert found(MapSource([(0.0, 0.0, 0.1)]), Told(Sighting(2.0, 1.0, 0.3, 0.05))) == [
        (0.0, 0.0, 0.1),
        (2.0, 1.0, 0.3),
    ]


def test_two_sightings_a_few_decimetres_apart_are_one_obstacle_between_them() -> None:
    assert found(Told(Sighting(1.0, 0.0, 0.2, 0.05), Sighting(1.2, 0.0, 0.3, 0.05))) == [
        pytest.approx((1.1, 0.0, 0.25))
    ]


def test_what_is_certain_is_not_moved_by_what_is_seen_with_noise() -> None:
    assert found(MapSource([(1.0, 0.0, 0.2)]), Told(Sighting(1.2, 0.0, 0.3, 0.05))) == [
        pytest.approx((1.0, 0.0, 0.2), abs=1e-3)
    ]


def test_the_more_often_the_better() -> None:
    draw = random.Random(1)
    seen = [Sighting(*(value + draw.gauss(0, 0.05) for value in (1.0, 2.0, 0.5)), 0.05) for _ in range(100)]
    (disc,) = found(Told(*seen))
    assert disc == pytest.approx((1.0, 2.0, 0.5), abs=0.02)


def test_a_drone_sees_those_in_reach_the_nearest_first() -> None:
    obstacles = Obstacles([MapSource([(3.0, 0.0, 0.5), (1.0, 0.0, 0.5), (9.0, 0.0, 0.5), (2.9, 5.0, 4.0)])])
    obstacles.look()
    assert [disc[0] for disc in obstacles.nearest(0.0, 0.0, 2.5)] == [1.0, 2.9, 3.0]
