"""Degradation curves: success over the values of one field, a line for each combination of the others."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rsc_swarm.show.plots.style import INK, ROCK, bare, look, new_figure, save


def draw(fields: Sequence[str], table: Sequence[dict[str, Any]], out: Path) -> None:
    """Draw the rows of rsc_swarm.study.sweep.rows into the file ``out``, with their 95 % intervals.

    Args:
        fields: what was swept; the first goes along x.

    Raises:
        PlotError: matplotlib is missing, or the file cannot be written.
    """
    first, *others = fields
    values = list(dict.fromkeys(row[first] for row in table))
    scaled = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    figure = new_figure(8.0, 4.6)
    axes = figure.add_subplot()
    bare(axes)
    lines: dict[str, list[dict[str, Any]]] = {}
    for row in table:
        lines.setdefault(", ".join(f"{field} {row[field]}" for field in others), []).append(row)
    for number, (label, rows) in enumerate(lines.items()):
        at = [row[first] if scaled else values.index(row[first]) for row in rows]
        below = [100 * (row["success"] - row["low"]) for row in rows]
        above = [100 * (row["high"] - row["success"]) for row in rows]
        axes.errorbar(
            at, [100 * row["success"] for row in rows], [below, above], label=label or None, lw=2, ms=5, capsize=4,
            marker="o", **look(number),
        )  # fmt: skip
    axes.set(xlabel=first, ylabel="success, %", ylim=(-3, 103))
    if not scaled:
        axes.set_xticks(range(len(values)), [str(value) for value in values])
    axes.set_title(f"{table[0]['runs']} flights a point", loc="left", fontsize=12, color=INK)
    if others:
        axes.legend(frameon=False, fontsize=9, labelcolor=ROCK)
    save(figure, out)
