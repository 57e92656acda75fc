"""Formations: the shapes of the standard task, and what holds for every slot tree."""

import math
from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.mission.formation import NO_PARENT, Formation, build_formation, default_shape, shape_points


def formation(shape: str, agents: int, spacing: float = 5.0) -> Formation:
    return build_formation(shape_points(shape, agents, spacing), spacing)


def rounded(offsets: np.ndarray) -> set[tuple[float, float]]:
    return {(round(float(x), 6) + 0.0, round(float(y), 6) + 0.0) for x, y in offsets}


def edge_lengths(layout: Formation) -> list[float]:
    edges = [(parent, child) for child, parent in enumerate(layout.parent) if parent != NO_PARENT]
    return [math.dist(layout.offsets[parent], layout.offsets[child]) for parent, child in edges]


def steps_from_root(layout: Formation) -> list[int]:
    """Fewest edges of one spacing from the root, found without the tree."""
    far = len(layout) + 1
    steps = [far] * len(layout)
    steps[layout.root] = 0
    queue = deque([layout.root])
    while queue:
        slot = queue.popleft()
        for other in range(len(layout)):
            gap = math.dist(layout.offsets[slot], layout.offsets[other])
            if steps[other] == far and abs(gap - layout.spacing) < 1e-6:
                steps[other] = steps[slot] + 1
                queue.append(other)
    return steps


def depth(layout: Formation, slot: int) -> int:
    count = 0
    while layout.parent[slot] != NO_PARENT:
        slot, count = int(layout.parent[slot]), count + 1
    return count


def test_twenty_five_drones_fly_a_square_around_its_middle() -> None:
    layout = formation(default_shape(25), 25)
    assert rounded(layout.offsets) == {(5.0 * x, 5.0 * y) for x in range(-2, 3) for y in range(-2, 3)}
    assert max(depth(layout, slot) for slot in range(25)) == 4


def test_the_root_of_an_even_square_is_the_rear_one_of_the_four_in_the_middle() -> None:
    layout = formation(default_shape(36), 36)
    # Of the four slots nearest the centroid: smallest x, both |y| equal, so the one to the right.
    assert rounded(layout.offsets) == {(5.0 * x, 5.0 * y) for x in range(-2, 4) for y in range(-2, 4)}


@pytest.mark.parametrize(("agents", "slots_a_side"), [(6, 3), (12, 5)])
def test_a_triangle_is_hollow_and_flies_with_its_base_behind(agents: int, slots_a_side: int) -> None:
    layout = formation(default_shape(agents), agents)
    x, y = layout.offsets[:, 0], layout.offsets[:, 1]
    side = 5.0 * (slots_a_side - 1)
    apex = layout.offsets[x.argmax()]
    base = layout.offsets[np.isclose(x, x.min())]
    assert np.sum(np.isclose(x, x.max())) == 1
    assert len(base) == slots_a_side
    assert np.ptp(base[:, 1]) == pytest.approx(side)
    corners = [apex, base[base[:, 1].argmin()], base[base[:, 1].argmax()]]
    for one, other in ((0, 1), (1, 2), (2, 0)):
        start, along = corners[one], (corners[other] - corners[one]) / side
        assert math.dist(corners[one], corners[other]) == pytest.approx(side)
        on_side = [p for p in layout.offsets if abs(np.cross([*along, 0], [*(p - start), 0])[2]) < 1e-6]
        assert len(on_side) == slots_a_side
    assert y.mean() == pytest.approx(apex[1])


def test_the_root_of_a_triangle_is_the_slot_nearest_the_centroid() -> None:
    for agents in (6, 12):
        layout = formation("triangle", agents)
        gaps = np.linalg.norm(layout.offsets - layout.offsets.mean(axis=0), axis=1)
        nearest = np.flatnonzero(gaps < gaps.min() + 1e-6)
        # Ties go to the smallest x.
        assert layout.root in nearest
        assert layout.offsets[layout.root, 0] == pytest.approx(layout.offsets[nearest, 0].min())


def test_auto_picks_a_square_then_a_triangle_then_a_vee() -> None:
    assert [default_shape(n) for n in (4, 25, 36, 3, 6, 12, 2, 5, 7, 100)] == [
        "square", "square", "square", "triangle", "triangle", "triangle", "vee", "vee", "vee", "square",
    ]  # fmt: skip


SHAPES = st.one_of(
    st.tuples(st.just("square"), st.integers(2, 10).map(lambda side: side * side)),
    st.tuples(st.just("triangle"), st.integers(1, 20).map(lambda third: 3 * third)),
    st.tuples(st.sampled_from(["vee", "line"]), st.integers(1, 60)),
)


@given(shape=SHAPES, spacing=st.floats(1, 20))
def test_every_tree_is_breadth_first_over_edges_of_one_spacing(
    shape: tuple[str, int], spacing: float
) -> None:
    layout = formation(*shape, spacing)
    assert edge_lengths(layout) == pytest.approx([spacing] * (len(layout) - 1))
    assert [depth(layout, slot) for slot in range(len(layout))] == steps_from_root(layout)
    assert layout.offsets[layout.root].tolist() == [0.0, 0.0]


def test_a_shape_that_does_not_fit_says_which_counts_do() -> None:
    with pytest.raises(ValueError, match=r"4, 9, 16, 25, 36, \.\.\. agents, not 10"):
        shape_points("square", 10, 5.0)
    with pytest.raises(ValueError, match="unknown shape 'blob'; known: square"):
        shape_points("blob", 10, 5.0)


def test_nobody_can_move_the_slots_of_a_formation() -> None:
    layout = formation("square", 4)
    with pytest.raises(ValueError, match="read-only"):
        layout.offsets[0, 0] = 1.0
