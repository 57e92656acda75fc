"""Pictures of figures: success against horizon, and the curves of a training."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from protocols.foreign_file import read_file
from rsc_swarm.show.plots.style import FAINT, INK, LINES, ROCK, PlotError, bare, look, new_figure, save
from rsc_swarm.study.tables.result import RowResult, TableResult

_PANELS = (
    ("loss", "loss", "log"),
    ("mae_m", "error of the foretold positions, 1e-4 m", "log"),
    ("success", "success of ended episodes, %", "linear"),
)
_SCALARS = TypeAdapter(dict[str, float | None])
_SCALE = {"loss": 1.0, "mae_m": 1e4, "success": 100.0}


def draw_horizons(result: TableResult, out: Path) -> None:
    """Success of the RSC models of a table against their horizon, as flown each way, with intervals, and the paper's.

    Raises:
        PlotError: the table has no RSC rows; else as canvas.
    """
    ways: dict[str, dict[int, RowResult]] = {}
    for row in result.rows:
        steps = row.policy.removeprefix("rsc-h").removesuffix("-paper")  # trained to the letter
        if steps.isascii() and steps.isdecimal() and not row.place:
            ways.setdefault(row.way, {})[int(steps)] = row
    if not ways:
        raise PlotError(f"table {result.table} has no RSC rows yet; rsc-swarm evaluate --table 1 flies them")
    papers = {h: row.paper.success_pct for rows in ways.values() for h, row in rows.items() if row.paper}
    horizons = sorted({horizon for rows in ways.values() for horizon in rows})
    figure = new_figure(8.0, 4.6)
    axes = figure.add_subplot()
    bare(axes)
    if papers:
        _line(axes, horizons, papers, "reported by the paper", color=FAINT, marker="s", ls=(0, (4, 3)))
    for number, (way, rows) in enumerate(ways.items()):
        values = {horizon: 100 * row.success_rate for horizon, row in rows.items()}
        _line(axes, horizons, values, f"{way}, flown here", marker="o", **look(number))
        for horizon, row in rows.items():
            at, (low, high) = horizons.index(horizon), row.success_interval
            axes.errorbar(
                at,
                100 * low,
                [[0], [100 * (high - low)]],
                color=look(number)["color"],
                lw=1.4,
                capsize=7,
                capthick=1.4,
                zorder=2,
            )
    axes.set(xlabel="horizon H, ticks of 10 ms", ylabel="success, %", ylim=(-3, 103))
    axes.set_xticks(range(len(horizons)), [str(horizon) for horizon in horizons])
    axes.set_xlim(-0.4, len(horizons) - 0.6)
    flown = [row for rows in ways.values() for row in rows.values()]
    fewest, most = min(row.runs for row in flown), max(row.runs for row in flown)
    runs = f"{most}" if fewest == most else f"{fewest} to {most}"
    axes.set_title(
        f"{flown[0].agents} drones, {runs} flights a point", loc="left", fontsize=12, color=INK, pad=28
    )
    _legend(axes)
    save(figure, out)


def _line(axes: Any, horizons: list[int], values: dict[int, float], label: str, **style: Any) -> None:
    at = sorted(values)
    axes.plot(
        [horizons.index(h) for h in at], [values[h] for h in at],
        lw=2, ms=5.5, mec="white", mew=0.8, label=label, zorder=3, **style,
    )  # fmt: skip


def _legend(axes: Any) -> None:
    """Lines of six between title and axes; they take no room from the panels."""
    legend = axes.legend(
        loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncols=len(LINES), frameon=False, fontsize=9, labelcolor=ROCK,
        handletextpad=0.5, columnspacing=1.4, borderaxespad=0.2,
    )  # fmt: skip
    legend.set_in_layout(False)


def draw_curves(folders: Sequence[Path], out: Path) -> None:
    """The curves of the trainings in ``folders``, one colour each: loss, error, success of the episodes flown.

    Raises:
        PlotError: a folder has no curve; else as canvas.
    """
    curves = {folder: read_curve(folder) for folder in folders}
    figure = new_figure(11.0, 3.8)
    panels = figure.subplots(1, len(_PANELS), sharex=True)
    for axes, (name, title, scale) in zip(panels, _PANELS, strict=True):
        bare(axes)
        for number, (folder, lines) in enumerate(curves.items()):
            points = [
                (updates / 1000, _SCALE[name] * value)
                for line in lines
                if (updates := line["updates"]) is not None and (value := line.get(name)) is not None
            ]
            if points:
                axes.plot(
                    *zip(*points, strict=True), lw=1.4, alpha=0.9, label=folder.name, zorder=3, **look(number)
                )
        axes.set_yscale(scale)
        if scale == "log":
            _plain_numbers(axes)
        axes.set_xlabel("thousand updates")
        axes.set_title(title, loc="left", fontsize=10, color=INK, pad=10 + 16 * -(-len(curves) // len(LINES)))
    panels[-1].set_ylim(-3, 103)
    _legend(panels[0])
    save(figure, out)


def _plain_numbers(axes: Any) -> None:
    """0.1, 0.2, 0.5, 1 and so on instead of powers of ten."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter("{x:g}")


def read_curve(folder: Path) -> list[dict[str, float | None]]:
    """The lines of ``curve.jsonl``, which training writes into its folder.

    Raises:
        PlotError: there is none, or it is something else.
    """
    path = folder / "curve.jsonl"
    try:
        texts = [line for line in read_file(path).decode().splitlines() if line.strip()]
        lines = [_SCALARS.validate_json(text, strict=True) for text in texts]
        if lines and all(line.get("updates") is not None for line in lines):
            return lines
    except OSError as error:
        raise PlotError(
            f"{path}: cannot be read ({error.strerror}); --curve wants a folder of rsc-swarm train"
        ) from None
    except ValueError:
        pass
    raise PlotError(f"{path}: is not the curve of a training")
