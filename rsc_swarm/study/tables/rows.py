"""What stands in each table: which controller is flown where and how."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from rsc_swarm.options import Formation, MissionOptions
from rsc_swarm.study.tables.letter import letter_rows
from rsc_swarm.study.tables.table import Paper, Place, Row, Table, Way

_PLAIN = Place("", "", MissionOptions())
_ALONE, _OURS = Way("", ""), Way("ours", "ours")
_LETTER = Way("letter", "to the letter")
# The paper has none of ours: the safety filter, detours, swaps with any drone in contact.
_PAPERS_SWAPS = ("swap.rule=tree", "swap.cooldown_s=1")
_NO_DETOUR = "detour=false"
_BARE = ("safety_filter=false", _NO_DETOUR)
_PAPERS_STEPS = ("trajectory.tracking=required", "trajectory.blend=true", *_BARE)
_UNAIDED = Way("no-blend", "without filter, without blend", (*_BARE, "trajectory.blend=false"))
_BASELINE = (Way("no-filter", "without filter", _BARE), Way("filter", "with filter", (_NO_DETOUR,)))


def _papers_way(horizon: int) -> Way:
    """The paper asks a model for its next trajectory when the last one has been flown to its end."""
    settings = (*_PAPERS_STEPS, *_PAPERS_SWAPS, f"trajectory.replan_ticks={horizon}")
    return Way("paper", "as in the paper", settings)


def _expert(place: Place, paper: Paper | None = None) -> Row:
    return Row(place, "Expert", _ALONE, "expert", paper)


def _baseline(place: Place, name: str, policy: str, paper: Paper | None = None) -> Iterator[Row]:
    for way in _BASELINE:
        yield Row(place, name, way, policy, paper)


def _analytic(place: Place) -> Iterator[Row]:
    yield Row(place, "Analytic", _BASELINE[0], "analytic")
    yield Row(place, "Analytic", _OURS, "analytic")


def _lettered(place: Place) -> Place:
    """The same place, with mission ``paper``: the paper's control to the letter."""
    return replace(place, options=replace(place.options, mission="paper"))


def _rsc(place: Place, horizon: int, paper: Paper | None = None) -> Iterator[Row]:
    """The three ways: the paper to the letter, the paper's control with our network, and ours."""
    yield Row(_lettered(place), f"RSC-H{horizon}", _LETTER, f"rsc-h{horizon}-paper", paper)
    yield from _our_network(place, horizon, paper)


def _our_network(place: Place, horizon: int, paper: Paper | None = None) -> Iterator[Row]:
    for way in (_papers_way(horizon), _OURS):
        yield Row(place, f"RSC-H{horizon}", way, f"rsc-h{horizon}", paper)


def _table_1() -> Iterator[Row]:
    papers_expert = Paper(96.0, 13.06, None, 3.0)
    yield _expert(_PLAIN, papers_expert)
    yield Row(_lettered(_PLAIN), "Expert", _LETTER, "paper-expert", papers_expert)
    yield from _analytic(_PLAIN)
    yield from _baseline(_PLAIN, "Saber", "saber", Paper(5.0, 15.47, None, 39.5))
    papers_stgnn = Paper(0.0, None, None, 72.0)
    unblended = replace(_LETTER, settings=("trajectory.blend=false",))  # its authors blend nothing in
    yield Row(_lettered(_PLAIN), "STGNN", unblended, "stgnn-paper", papers_stgnn)
    yield Row(_PLAIN, "STGNN", _UNAIDED, "stgnn", papers_stgnn)
    yield from _baseline(_PLAIN, "STGNN", "stgnn", papers_stgnn)
    yield from _rsc(_PLAIN, 1, Paper(0.0, None, 4.0, 95.5))
    yield from _rsc(_PLAIN, 10, Paper(58.5, 13.11, 6.2, 23.0))
    yield from _rsc(_PLAIN, 20, Paper(83.0, 13.17, 7.9, 2.5))
    yield from _rsc(_PLAIN, 30, Paper(81.5, 13.32, 11.17, 3.0))
    yield from _rsc(_PLAIN, 40, Paper(82.5, 13.62, 13.48, 2.5))


def _size(
    agents: int, shape: str, papers: dict[str, Paper], **options: Any
) -> tuple[Place, dict[str, Paper]]:
    return Place(f"n{agents}", f"{agents}, {shape}", MissionOptions(agents=agents, **options)), papers


def _table_2() -> Iterator[Row]:
    sizes = (
        _size(6, "triangle", {
            "Expert": Paper(97.0, 9.51, None, 0.4), "H20": Paper(90.5, 9.72, 11.25, 1.0),
            "H30": Paper(95.5, 9.61, 15.03, 0.0), "H40": Paper(92.5, 9.77, 17.95, 1.0),
        }),
        _size(12, "triangle", {
            "Expert": Paper(95.4, 11.63, None, 0.0), "H20": Paper(90.0, 11.70, 7.70, 0.0),
            "H30": Paper(90.5, 11.55, 13.83, 0.0), "H40": Paper(87.5, 11.74, 11.01, 2.0),
        }),
        _size(36, "square", {
            "Expert": Paper(89.8, 15.17, None, 6.8), "H20": Paper(76.0, 15.43, 9.10, 2.0),
            "H30": Paper(76.5, 15.53, 12.03, 2.5), "H40": Paper(73.0, 15.52, 15.10, 2.5),
        }),
        _size(49, "square", {}),
        _size(15, "V", {}, formation=Formation.vee),
    )  # fmt: skip
    for place, papers in sizes:
        yield _expert(place, papers.get("Expert"))
        yield Row(_lettered(place), "Expert", _LETTER, "paper-expert", papers.get("Expert"))
        yield Row(place, "Analytic", _OURS, "analytic")
        for horizon in (20, 30, 40) if papers else (20,):
            yield from _rsc(place, horizon, papers.get(f"H{horizon}"))


def _table_3() -> Iterator[Row]:
    papers = {
        (True, True): Paper(83.0, 13.17, 7.90, 2.5),
        (False, True): Paper(78.5, 13.05, 8.35, 2.5),
        (True, False): Paper(49.5, 13.01, 7.75, 34.0),
        (False, False): Paper(38.0, 12.08, 8.75, 36.0),
    }
    ways = ((_LETTER, "paper", "rsc-h20-paper"), (_papers_way(20), None, "rsc-h20"), (_OURS, None, "rsc-h20"))
    for way, mission, policy in ways:
        for (blend, swaps), paper in papers.items():
            place = Place(
                f"{'blend' if blend else 'no-blend'}/{'swaps' if swaps else 'no-swaps'}",
                f"{'with' if blend else 'without'} / {'with' if swaps else 'without'}",
                MissionOptions(mission=mission),
            )
            off = (() if blend else ("trajectory.blend=false",)) + (() if swaps else ("swap.rule=off",))
            yield Row(place, "RSC-H20", replace(way, settings=way.settings + off), policy, paper)


_HEARD = "sensing.neighbours=heard"


def _heard() -> Iterator[Row]:
    """Neighbours known by radio alone: here what is lost of it can collide drones."""
    dense = MissionOptions(mission="dense", frame_rate=10.0)
    for place in (
        Place("heard-70", "poor-radio-70, heard", MissionOptions(mission="poor-radio-70", set=[_HEARD])),
        Place("heard-n12", "dense, 12 drones, 70 % lost, heard",
              replace(dense, agents=12, burst=0.7, set=[_HEARD])),
        Place("heard-dense", "dense, scrambled, 50 % lost, heard",
              replace(dense, burst=0.5, set=["start.scrambled=true", _HEARD])),
    ):  # fmt: skip
        yield Row(place, "Analytic", _OURS, "analytic")
        yield Row(place, "RSC-H20", _OURS, "rsc-h20")


_HARDER = ("dense", "scrambled", "slow-leader", "fast-target", "poor-radio-30", "poor-radio-50", "poor-radio-70",
           "lost-agent")  # fmt: skip
_EXPERTS = ("dense", "scrambled", "fast-target")  # it has no radio that could be poor, and nobody to lose
_OFTEN = Way("every-10", "ours, a plan every 10 ticks", ("trajectory.replan_ticks=10",))
_STRAIGHT = Way("no-detour", "ours, without detours", (_NO_DETOUR,))
_FORGETFUL = Way(
    "no-memory", "without detours, obstacles not remembered", ("sensing.obstacle_memory=false", _NO_DETOUR)
)


def _table_harder() -> Iterator[Row]:
    for mission in _HARDER:
        place = Place(mission, mission, MissionOptions(mission=mission))
        if mission in _EXPERTS:
            yield _expert(place)
        if mission == "dense":
            yield Row(place, "Analytic", _FORGETFUL, "analytic")
            yield Row(place, "Analytic", _STRAIGHT, "analytic")
        yield Row(place, "Analytic", _OURS, "analytic")
        yield from _our_network(place, 20)
        if mission == "dense":
            yield Row(place, "RSC-H20", _STRAIGHT, "rsc-h20")
            yield Row(place, "RSC-H20", _OFTEN, "rsc-h20")
    yield from _heard()


_RULES = (
    Way("agreed", "agreed"),
    Way("highest-version", "highest version", ("swap.protocol=highest-version",)),
    Way("no-swaps", "no swaps", ("swap.rule=off",)),
)


def _table_slots() -> Iterator[Row]:
    for mission in ("scrambled", "form-up", "slow-leader", "lost-agent"):
        for agents in (12, 25, 36):
            place = Place(
                f"{mission}/n{agents}", f"{mission}, {agents}", MissionOptions(mission=mission, agents=agents)
            )
            for way in _RULES:
                yield Row(place, "Analytic", way, "analytic")


TABLES = {
    table.name: table
    for table in (
        Table("1", "25 drones", "", tuple(_table_1())),
        Table("2", "Other sizes, without training for them", "drones", tuple(_table_2())),
        Table("3", "What the blend and the swaps are worth", "blend / swaps", tuple(_table_3())),
        Table("harder", "Harder fields, 25 drones", "field", tuple(_table_harder())),
        Table("letter", "From the paper to the letter to ours", "change", tuple(letter_rows())),
        Table("slots", "Rules for trading slots", "field, drones", tuple(_table_slots()), of_slots=True),
    )
}
