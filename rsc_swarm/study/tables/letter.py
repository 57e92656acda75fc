"""From the paper's control to the letter to ours, one change at a time: what each change is worth, and what it is worth beside
the others.

Every row flies mission ``paper`` with some of `STEPS` made; with all of them made it is the default mission. Changes that stand
in for each other, or need each other, are worth something else first than last, so they are made in one order and in the other,
and each also alone on the letter and alone taken from ours.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from rsc_swarm.options import MissionOptions
from rsc_swarm.study.tables.table import Paper, Place, Row, Way


@dataclass(frozen=True)
class Step:
    """One change from the paper to ours. word: for keys; title: for people; settings: on top of mission ``paper``."""

    word: str
    title: str
    settings: tuple[str, ...]


STEPS = (
    Step("filter", "safety filter", ("safety_filter=true",)),
    Step("memory", "obstacles remembered", ("sensing.obstacle_memory=true",)),
    Step("aim", "steering to the slot", ("aim=slot",)),
    Step(
        "contact", "swaps with any in contact", ("swap.rule=contact", "swap.connected=false", "swap.cooldown_s=0.2")
    ),
    Step("agreed", "agreeing before swapping", ("swap.protocol=agreed",)),
    Step("smooth", "smooth tracking", ("trajectory.tracking=smooth",)),
    Step("blend", "our controller blended in", ("trajectory.blend_with=analytic",)),
    Step("detour", "detours", ("detour=true",)),
)  # fmt: skip

_MODEL = "rsc-h20"
_MISSION = MissionOptions(mission="paper")
_REPORTED = Paper(83.0, 13.17, 7.90, 2.5)
_ABLATION = (
    ("no-blend", "letter, no blend", ("trajectory.blend=false",), Paper(78.5, 13.05, 8.35, 2.5)),
    ("no-swaps", "letter, no swaps", ("swap.rule=off",), Paper(49.5, 13.01, 7.75, 34.0)),
    ("neither", "letter, neither", ("trajectory.blend=false", "swap.rule=off"), Paper(38.0, 12.08, 8.75, 36.0)),
)  # fmt: skip
_HORIZONS = (
    (1, Paper(0.0, None, 4.0, 95.5)),
    (10, Paper(58.5, 13.11, 6.2, 23.0)),
    (30, Paper(81.5, 13.32, 11.17, 3.0)),
    (40, Paper(82.5, 13.62, 13.48, 2.5)),
)
_OTHER_SEEDS = (1, 2)  # of the training of H20
_EXPERT = Paper(96.0, 13.06, None, 3.0)


def letter_rows() -> Iterator[Row]:
    """The rows of table ``letter``."""
    last, back = len(STEPS), STEPS[::-1]
    ends = Place("", "the ends", _MISSION)
    yield _row(ends, Way("letter", "letter"), (), _REPORTED)
    yield _row(ends, Way("ours", "ours"), STEPS)
    for step in STEPS:
        yield _row(Place("alone", "letter, and only", _MISSION), _way("+", step), (step,))
    for step in STEPS:
        others = tuple(other for other in STEPS if other is not step)
        yield _row(Place("all-but", "ours, all but", _MISSION), _way("-", step), others)
    for word, title, order in (("onward", "letter to ours", STEPS), ("back", "in the other order", back)):
        for made in range(1, last):
            yield _row(Place(word, title, _MISSION), _way("+", order[made - 1]), order[:made])
    ablated = Place("ablation", "the paper's ablation", _MISSION)
    for word, title, settings, paper in _ABLATION:
        yield Row(ablated, "RSC-H20", Way(word, title, settings), _MODEL, paper)
    for horizon, paper in _HORIZONS:
        yield Row(
            Place("horizon", "horizons", _MISSION),
            f"RSC-H{horizon}",
            Way("letter", "letter"),
            f"rsc-h{horizon}",
            paper,
        )
    trained = Place("trained", "trained to the letter", _MISSION)
    yield Row(trained, "RSC-H20", Way("letter", "letter"), f"{_MODEL}-paper", _REPORTED)
    for word, title, settings, paper in _ABLATION:
        yield Row(trained, "RSC-H20", Way(word, title, settings), f"{_MODEL}-paper", paper)
    for step in STEPS:
        way = Way(step.word, f"letter, + {step.title}", step.settings)
        yield Row(trained, "RSC-H20", way, f"{_MODEL}-paper")
    for horizon, paper in _HORIZONS:
        yield Row(trained, f"RSC-H{horizon}", Way("letter", "letter"), f"rsc-h{horizon}-paper", paper)
    for seed in _OTHER_SEEDS:
        way = Way(f"seed-{seed}", f"letter, training seed {seed}")
        yield Row(trained, "RSC-H20", way, f"{_MODEL}-paper-{seed}", _REPORTED)
    yield from _experts(Place("experts", "experts", _MISSION))


def _experts(place: Place) -> Iterator[Row]:
    """The paper's expert and ours, each with the paper's swaps and with ours. Nothing else of `STEPS` concerns them."""
    ours = STEPS[3].settings + STEPS[4].settings
    for policy, name in (("paper-expert", "the paper's"), ("expert", "our own")):
        paper = _EXPERT if policy == "paper-expert" else None
        yield Row(place, "Expert", Way(policy, f"{name}, letter's swaps"), policy, paper)
        yield Row(place, "Expert", Way(f"{policy}/contact", f"{name}, our swaps", ours), policy)


def _row(place: Place, way: Way, made: tuple[Step, ...], paper: Paper | None = None) -> Row:
    settings = tuple(text for step in made for text in step.settings)
    return Row(place, "RSC-H20", Way(way.word, way.title, settings), _MODEL, paper)


def _way(sign: str, step: Step) -> Way:
    return Way(step.word, f"{sign} {step.title}")
