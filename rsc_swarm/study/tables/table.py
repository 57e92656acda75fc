"""What a table is made of: rows, each a controller flown in a way at a place, and what the paper reports for it.

A row is flown by `rsc-swarm evaluate` with its options. Its key is made of words, such as ``n36/rsc-h20/paper``; `chosen` finds
rows by some of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

from protocols.mission.document import MissionError
from rsc_swarm.options import MissionOptions


@dataclass(frozen=True)
class Paper:
    """A row of the paper: S and D in %, tau in s, MAE in 1e-4 m; None where it has a dash."""

    success_pct: float
    tau_s: float | None
    mae_1e4_m: float | None
    noncollision_pct: float

    @property
    def collision_pct(self) -> float:
        """C in %: the paper counts every failure as a collision or as D."""
        return 100 - self.success_pct - self.noncollision_pct


@dataclass(frozen=True)
class Place:
    """Where rows are flown. word: for keys; title: for people; options: the mission."""

    word: str
    title: str
    options: MissionOptions


@dataclass(frozen=True)
class Way:
    """How a controller is flown. word: for keys; title: for people; settings: on top of the mission."""

    word: str
    title: str
    settings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One row: a controller (name), flown in a way at a place, and the paper's figures where it has them."""

    place: Place
    name: str
    way: Way
    policy: str
    paper: Paper | None = None

    @property
    def key(self) -> str:
        """The row's words, joined by slashes; no two rows of a table have the same."""
        return "/".join(word for word in (self.place.word, self.name.lower(), self.way.word) if word)

    @property
    def options(self) -> MissionOptions:
        """What `rsc-swarm evaluate` is told to fly this row."""
        texts = (*(self.place.options.set or ()), *self.way.settings)
        settings = dict(text.split("=") for text in texts)  # the last word on a field counts
        return replace(
            self.place.options,
            policy=self.policy,
            set=[f"{name}={value}" for name, value in settings.items()],
        )


@dataclass(frozen=True)
class Table:
    """A table. name: for ``--table``; places: the heading over the rows' places, empty if there is only one; of_slots: it
    shows what trading slots cost."""

    name: str
    title: str
    places: str
    rows: tuple[Row, ...]
    of_slots: bool = False


class Keyed(Protocol):
    """What has the key of a row."""

    @property
    def key(self) -> str:
        """Words, joined by slashes."""


K = TypeVar("K", bound=Keyed)


def chosen(rows: Sequence[K], names: str | None, where: str) -> list[K]:
    """Those of ``rows`` that ``--rows`` asks for: each name, between commas, takes the rows that have all its words.

    Args:
        where: where the rows stand, for people: "table 2".

    Raises:
        MissionError: a name that no row has.
    """
    wanted = [frozenset(name.strip().split("/")) for name in (names or "").split(",") if name.strip()]
    words = [frozenset(row.key.split("/")) for row in rows]
    for name in wanted:
        if not any(name <= of_row for of_row in words):
            known = list(dict.fromkeys(word for row in rows for word in row.key.split("/")))
            raise MissionError(
                f"--rows {'/'.join(sorted(name))}: no such row in {where}; its words are {', '.join(known)}"
            )
    pairs = zip(rows, words, strict=True)
    return [row for row, of_row in pairs if not wanted or any(name <= of_row for name in wanted)]
