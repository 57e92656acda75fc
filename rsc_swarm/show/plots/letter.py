"""The picture of table ``letter``: from the paper's control to ours, one change after the other, in both orders."""

from pathlib import Path
from typing import Any

from rsc_swarm.show.plots.style import ALARM, FAINT, INK, LINES, PlotError, bare, new_figure, save
from rsc_swarm.study.tables.result import RowResult, TableResult

_SHARES = (
    ("success_rate", "success", LINES[2]),
    ("noncollision_rate", "late", FAINT),
    ("collision_rate", "collision", ALARM),
)


def draw_letter(result: TableResult, out: Path) -> None:
    """Bars of how flights ended, a bar per change, the letter on top and ours below; success with its interval.

    Raises:
        PlotError: rows of the two orders are missing; else as canvas.
    """
    rows = {row.key: row for row in result.rows}
    letter, ours = (rows.get(f"rsc-h20/{end}") for end in ("letter", "ours"))
    orders = [[row for row in result.rows if row.key.startswith(f"{word}/")] for word in ("onward", "back")]
    if letter is None or ours is None or not all(orders):
        raise PlotError(
            f"table {result.table} lacks rows of the steps; rsc-swarm evaluate --table letter flies them"
        )
    figure = new_figure(11.0, 4.4)
    panels = figure.subplots(1, 2)
    for axes, order in zip(panels, orders, strict=True):
        _bars(axes, [letter, *order, ours], order[0].place)
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="lower center",
        ncols=len(_SHARES),
        frameon=False,
        fontsize=9,
    )
    figure.subplots_adjust(bottom=0.2)
    save(figure, out)


def _bars(axes: Any, rows: list[RowResult], title: str) -> None:
    bare(axes)
    at = range(len(rows))
    left = [0.0] * len(rows)
    for name, label, colour in _SHARES:
        widths = [100 * getattr(row, name) for row in rows]
        axes.barh(at, widths, left=left, height=0.7, color=colour, label=label, zorder=2)
        left = [start + width for start, width in zip(left, widths, strict=True)]
    for place, row in enumerate(rows):
        low, high = row.success_interval
        axes.plot([100 * low, 100 * high], [place, place], color=INK, lw=1.2, zorder=3)
    axes.set_yticks(at, [row.way for row in rows])
    axes.invert_yaxis()
    axes.set(xlim=(0, 100), xlabel="flights, %")
    axes.set_title(f"{title}, {rows[0].runs} flights a bar", loc="left", fontsize=11, color=INK)
