"""The field as lines of text, seen from above: braille dots for obstacles and the goal line, a sign for every drone.

A character is two dots wide and four tall, so that a dot is as wide as tall; x to the right, y up.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from rich.segment import Segment, Segments
from rich.style import Style
from rich.text import Text

from world.outlets.snapshot import AgentRow, Snapshot

_MARGIN_M = 1.5
_LONGEST_M, _AROUND_M = 300.0, 100.0  # a longer field is seen in part: so much of it
_BLANK = 0x2800
_BITS = np.array(
    [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]]
)  # of the dots in a character, by row and column
_OFF = 0.1  # edges that are off by more are yellow, as in the table
_FIELD, _GREEN, _YELLOW, _RED = (Style(color=name) for name in ("bright_black", "green", "yellow", "red"))
_DRONE, _OFF_DRONE, _HUNG, _LOST = (
    Segment("●", _GREEN),
    Segment("●", _YELLOW),
    Segment("◌", _YELLOW),
    Segment("×", _RED),
)
_GOAL = "┊"
LEGEND = Text.assemble(
    ("map: ", "dim"), ("●", "green"), (" drone, ", "dim"), ("●", "yellow"), (" its edge is off, ", "dim"), ("◌", "yellow"),
    (" hung, ", "dim"), ("×", "red"), (" lost, ", "dim"), ("⣿", "bright_black"), (" obstacle, ", "dim"),
    (_GOAL, "bright_black"), (" goal", "dim"), no_wrap=True, overflow="ellipsis",
)  # fmt: skip


class FieldMap:
    """Draws moments of one flight, all to one scale: the frame holds the field, and grows with what flies out of it."""

    def __init__(self) -> None:
        self._low, self._high = np.full(2, np.inf), np.full(2, -np.inf)
        self._ground: tuple[tuple[float, ...], list[str]] = ((), [])

    def draw(self, snapshot: Snapshot, columns: int, lines: int) -> Segments | None:
        """One moment in so many lines of at most so many columns; None where nobody flies or ever flew."""
        self._see(snapshot)
        if not np.isfinite(self._low).all():
            return None
        (left, bottom), (right, upper) = self._low.tolist(), self._high.tolist()
        dot_m = max((right - left) / (2 * columns), (upper - bottom) / (4 * lines), 1e-9)
        top = (bottom + upper) / 2 + dot_m * 2 * lines
        wide = min(columns, int((right - left) / dot_m / 2) + 1)
        ground = self._field(snapshot, (left, top, dot_m, wide, lines))
        signs: list[dict[int, Segment]] = [{} for _ in ground]
        for row in sorted(snapshot.agents, key=_is_flying):  # who flies lies over who does not
            column, line = int((row.x_m - left) / dot_m / 2), int((top - row.y_m) / dot_m / 4)
            if 0 <= line < lines and 0 <= column < wide:
                signs[line][column] = _sign(row)
        return Segments(
            part for text, there in zip(ground, signs, strict=True) for part in _line(text, there)
        )

    def _field(self, snapshot: Snapshot, frame: tuple[float, float, float, int, int]) -> list[str]:
        """Obstacles and the goal line, which change only with the frame: left and top edge, m, m to a dot, columns, lines."""
        if self._ground[0] != frame:
            left, top, dot_m, wide, lines = frame
            codes = _characters(_dots(snapshot, left, top, dot_m, (4 * lines, 2 * wide)))
            goal = int((snapshot.goal_x_m - left) / dot_m / 2)
            self._ground = (
                frame,
                [
                    "".join(
                        chr(_BLANK + code) if code else _GOAL if column == goal else " "
                        for column, code in enumerate(line)
                    )
                    for line in codes.tolist()
                ],
            )
        return self._ground[1]

    def _see(self, snapshot: Snapshot) -> None:
        """Let the frame hold all that there is; of a field too long for that, what is around the swarm."""
        flying = [(row.x_m, row.y_m) for row in snapshot.agents if row.state != "lost"]
        if not flying:
            return
        places = np.array(flying)
        low, high = places.min(axis=0) - _MARGIN_M, places.max(axis=0) + _MARGIN_M
        end = snapshot.goal_x_m + snapshot.depth_m + _MARGIN_M
        if end - min(low[0], self._low[0]) > _LONGEST_M:
            self._low[0], self._high[0] = low[0], max(high[0], low[0] + _AROUND_M)
        else:
            discs = np.array(snapshot.discs).reshape(-1, 3)
            corners = (
                [low, *(discs[:, :2] - discs[:, 2:])],
                [high, (end, high[1]), *(discs[:, :2] + discs[:, 2:])],
            )
            low, high = np.min(corners[0], axis=0), np.max(corners[1], axis=0)
            self._low[0], self._high[0] = min(low[0], self._low[0]), max(high[0], self._high[0])
        self._low[1], self._high[1] = min(low[1], self._low[1]), max(high[1], self._high[1])


def _is_flying(row: AgentRow) -> bool:
    return row.state == "flying"


def _line(ground: str, signs: dict[int, Segment]) -> Iterator[Segment]:
    """A line of the map: the field, and the drones in it by column."""
    begin = 0
    for column in sorted(signs):
        yield Segment(ground[begin:column], _FIELD)
        yield signs[column]
        begin = column + 1
    yield Segment(ground[begin:], _FIELD)
    yield Segment.line()


def _dots(
    snapshot: Snapshot, left: float, top: float, dot_m: float, shape: tuple[int, int]
) -> NDArray[np.bool_]:
    """Which dots obstacles cover, (tall, wide)."""
    x = left + dot_m * (np.arange(shape[1]) + 0.5)
    y = top - dot_m * (np.arange(shape[0]) + 0.5)
    dots = np.zeros(shape, np.bool_)
    for disc_x, disc_y, radius in snapshot.discs:
        dots |= (x[None] - disc_x) ** 2 + (y[:, None] - disc_y) ** 2 <= radius**2
    return dots


def _characters(dots: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(tall / 4, wide / 2) braille patterns of dots (tall, wide)."""
    tall, wide = dots.shape
    blocks = dots.reshape(tall // 4, 4, wide // 2, 2)
    return np.asarray(np.einsum("ijkl,jl->ik", blocks.astype(np.int64), _BITS))


def _sign(row: AgentRow) -> Segment:
    if row.state == "lost":
        return _LOST
    if row.state == "frozen":
        return _HUNG
    return _DRONE if row.edge_error < _OFF else _OFF_DRONE
