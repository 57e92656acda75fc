"""Tables for people: the paper's figures and ours side by side, as Markdown, and on a terminal drawn."""

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table as Drawn
from rich.text import Text

from rsc_swarm.study.evaluate import flown_on
from rsc_swarm.study.tables.result import RowResult, TableResult
from rsc_swarm.study.tables.rows import TABLES
from rsc_swarm.study.tables.table import Paper

_LEGEND = (
    "S success with its 95 % interval, C collision, D any other failure; tau: mean time to success; "
    "formed: mean time at which the formation first stood; swaps: made per flight. "
)
_PAPERS = (
    "The paper's columns are what it reports, its C what S and D leave. "
    "Its tau belongs to another task: here the rear row cannot be past the goal line that soon, so compare tau "
    "only with this project's own expert. "
)
_STRICT = (
    "S strict: success by the stricter rules of task.md; slot: mean over successes of the worst slot error then; "
    "stood 2 s, agreed: of all flights, those that succeeded and whose formation stood for 2 s more, and those in which all "
    "drones had one view of the slots at success. "
)
_MAE = (
    "MAE: mean absolute error of the foretold positions over the horizon, in 1e-4 m, and beside it that of "
    "foretelling constant velocity. "
)
_WAYS = (
    "*As in the paper*: the paper's a_req follows the plan to its end before the next is made, blended with its "
    "potential field near others; no safety filter, no detours; only leader and follower swap, at most once a second. "
    "That is not the paper to the letter ([paper.md](paper.md)): the network is ours, drones steer to their slots and not "
    "by their leaders, agree before they swap, and remember obstacles. "
    "*Ours*: the defaults, with detours and the safety filter last. "
)
_TO_THE_LETTER = (
    "*To the letter*: mission `paper`, the paper's control and expert to the letter, and networks that were trained to the "
    "letter with 25 drones ([paper.md](paper.md)). "
)
_POOR_RADIO = (
    "*poor-radio*: drones sense their neighbours all the same; what gets lost is what they say of slots. "
)
_HEARD = "*heard*: they know of their neighbours by radio alone, at 10 frames a second, so what gets lost can collide them. "
_LETTER = (
    "*Letter*: mission `paper`, the paper's control to the letter ([paper.md](paper.md)), with our network. *Ours*: all eight "
    "changes made, which is the default mission. *+*: this change made; *-*: all made but this one. In *letter to ours* and *in "
    "the other order* a row has the changes of all rows above it, too. How much a change is worth beside the others, one sees "
    "from what it adds where it comes first and where it comes last. "
)
_SLOT_COLUMNS = ("undone", "two in a slot s")  # of the table that is about slots
_SLOTS = (
    "*Agreed* (the default): both drones of a swap agree before either moves; *highest version*: one drone swaps at "
    "once, and of two views the one that changed more often wins. undone: swaps that a merge undid, per flight; "
    "two in a slot: time during which drones claimed one slot, summed over drones. "
)
_PAGE = """# Results

The paper's tables, flown again under the definitions of [task.md](task.md), and what harder fields and other rules for trading
slots do. Each row can be flown alone: its command is in the JSON beside this page. A whole table: `rsc-swarm evaluate --table 1`,
and so on. This page is made from the JSON by `rsc-swarm tables docs/results`. `rsc-swarm tables docs/results --verify` flies some
flights of each row again, failed ones and others, and says which rows still come out so; a row's commit is in the JSON.
"""


_BEFORE = {  # what stands on the page before a table
    "letter": """Where our figures and the paper's part, and by what: from its control to the letter to ours, one change at a
time. What follows from it is in [paper.md](paper.md#every-miss-explained).

![How flights end, from the letter to ours, in both orders](letter.png)

*`rsc-swarm plot --letter docs/results/table-letter.json --out docs/letter.png`. Black: the 95 % interval of the success.*

"""
}


def markdown(result: TableResult) -> str:
    """The table and its legend."""
    lines = cells(result)
    lines.insert(1, ["---"] * len(lines[0]))
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"{table}\n\n{legend(result)}\n"


def drawn(result: TableResult) -> RenderableType:
    """The same for a terminal."""
    first, *rest = cells(result)
    title = f"Table {result.table}: {result.title}"
    table = Drawn(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    figures = _figures(result.rows[0])
    for name in first:
        table.add_column(name, justify="right" if name in figures else "left")
    for line in rest:
        table.add_row(*line)
    return Group(table, Text(legend(result).replace("*", "")))


def page(results: list[TableResult]) -> str:
    """All tables on one page of documentation."""
    heads = [
        f"## {'Table ' if result.table.isdigit() else ''}{result.table}: {result.title}\n\n"
        f"{_BEFORE.get(result.table, '')}"
        for result in results
    ]
    return "\n".join([_PAGE, *(head + markdown(result) for head, result in zip(heads, results, strict=True))])


def legend(result: TableResult) -> str:
    """What the columns mean, and what was flown."""
    rows = result.rows
    text = _LEGEND
    text += _PAPERS if any(row.paper for row in rows) else ""
    text += _STRICT if any(row.strict_rate is not None for row in rows) else ""
    text += _MAE if any(row.accuracy for row in rows) else ""
    text += _TO_THE_LETTER if any(row.way == "to the letter" for row in rows) else ""
    text += _WAYS if any(row.way == "as in the paper" for row in rows) else ""
    text += _POOR_RADIO if any(row.place.startswith("poor-radio") for row in rows) else ""
    text += _HEARD if any("heard" in row.place for row in rows) else ""
    text += _LETTER if result.table == "letter" else ""
    text += _SLOTS if TABLES[result.table].of_slots else ""
    flown = sorted({(row.runs, row.maps, row.starts) for row in rows})
    for runs, maps, starts in flown:
        text += f"{runs} runs: {flown_on(maps, starts)}. "
    return text.strip()


def cells(result: TableResult) -> list[list[str]]:
    """The heading and a line per row; a column in which nobody has a figure is left out."""
    table = TABLES[result.table]
    lines = [
        {table.places: row.place, "model": row.name, "flown": row.way, **_figures(row)} for row in result.rows
    ]
    hidden = () if table.of_slots else _SLOT_COLUMNS
    columns = [
        name for name in lines[0] if name not in hidden and any(line[name] not in ("", "-") for line in lines)
    ]
    return [columns, *([line[name] for name in columns] for line in lines)]


def _figures(row: RowResult) -> dict[str, str]:
    papers, model, floor = _papers(row.paper), None, None
    if row.accuracy:
        model, floor = row.accuracy.model_m, row.accuracy.constant_velocity_m
    undone, shared = _SLOT_COLUMNS
    return {
        "runs": str(row.runs),
        "S %": _rate(row.success_rate, row.success_interval),
        "paper's S": papers["S"],
        "S strict %": _rate(row.strict_rate, row.strict_interval),
        "C %": _number(row.collision_rate, 1, 100),
        "paper's C": papers["C"],
        "D %": _number(row.noncollision_rate, 1, 100),
        "paper's D": papers["D"],
        "tau s": _number(row.tau_mean_s, 2),
        "paper's tau": papers["tau"],
        "MAE": _number(model, 2, 1e4),
        "paper's MAE": papers["MAE"],
        "constant velocity's": _number(floor, 2, 1e4),
        "slot m": _number(row.slot_error_mean_m, 2),
        "stood 2 s %": _number(row.stood_on_rate, 1, 100),
        "agreed %": _number(row.agreed_at_success_rate, 1, 100),
        "formed s": _number(row.formed_mean_s, 2),
        "swaps": _number(row.swaps_per_flight, 1),
        undone: _number(row.undone_per_flight, 1),
        shared: _number(row.overlap_mean_s, 2),
    }


def _papers(paper: Paper | None) -> dict[str, str]:
    if paper is None:
        return dict.fromkeys(("S", "C", "D", "tau", "MAE"), "-")
    return {
        "S": _number(paper.success_pct, 1),
        "C": _number(paper.collision_pct, 1),
        "D": _number(paper.noncollision_pct, 1),
        "tau": _number(paper.tau_s, 2),
        "MAE": _number(paper.mae_1e4_m, 2),
    }


def _rate(share: float | None, interval: tuple[float, float] | None) -> str:
    if share is None or interval is None:
        return "-"
    low, high = interval
    return f"{100 * share:.1f} ({100 * low:.1f} to {100 * high:.1f})"


def _number(value: float | None, digits: int, scale: float = 1.0) -> str:
    return "-" if value is None else f"{scale * value:.{digits}f}"
