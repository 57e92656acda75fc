"""What all pictures share: colours, bare axes, and a file at the end.

Needs matplotlib (``pip install matplotlib``), which nothing else does.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocols.errors import SwarmError
from protocols.whole_file import write_whole

INK, FAINT, ROCK, ALARM, GRID = "#1f2933", "#9aa5b1", "#52606d", "#d64545", "#e4e7eb"
LINES = (
    "#2363b8",
    "#d97706",
    "#0f9d76",
    "#8b4fc4",
    "#c2416b",
    "#6b7280",
)  # told apart also by colour-blind eyes


_DASHES = ("-", (0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))


_SETTINGS = "matplotlib cannot draw by its settings: look at MPLBACKEND, MPLCONFIGDIR and matplotlibrc"


class PlotError(SwarmError, RuntimeError):
    """No picture can be made; one line says why."""


def look(number: int) -> dict[str, Any]:
    """How the line of this number, from 0, is told from the others: by its colour, and from the seventh on by dashes."""
    return {"color": LINES[number % len(LINES)], "ls": _DASHES[number // len(LINES) % len(_DASHES)]}


def new_figure(width: float, height: float) -> Any:
    """An empty figure of this size, inches.

    Raises:
        PlotError: matplotlib is missing, or cannot be loaded.
    """
    try:
        import matplotlib.figure
    except ImportError:
        raise PlotError("plot needs matplotlib: pip install matplotlib") from None
    except Exception as error:  # what its settings can do to it has no base of its own
        raise PlotError(f"{_SETTINGS} ({error})") from None
    return matplotlib.figure.Figure(figsize=(width, height))


def bare(axes: Any) -> None:
    """Take the box and the ticks away; leave a faint grid."""
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)
    axes.tick_params(colors=ROCK, length=0, labelsize=9)
    axes.xaxis.label.set_color(ROCK)
    axes.yaxis.label.set_color(ROCK)
    axes.grid(color=GRID, lw=0.6, zorder=0)
    axes.set_axisbelow(True)


def halo(colour: str, width: float = 2.0) -> list[Any]:
    """What keeps a text readable on top of lines: its outline in ``colour``."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground=colour)]


def number(
    axes: Any,
    value: int,
    place: Sequence[float] | NDArray[np.float64],
    colour: str = INK,
    centred: bool = False,
) -> Any:
    """Write the number of a drone or an obstacle: beside ``place`` (m), where no edge of a formation runs, or on it."""
    return axes.annotate(
        str(value), (float(place[0]), float(place[1])), (0, 0) if centred else (4, 4), textcoords="offset points",
        ha="center" if centred else "left", va="center" if centred else "bottom", fontsize=7.5, color=colour,
        path_effects=halo(ROCK if centred else "white"), annotation_clip=True, zorder=10,
    )  # fmt: skip


def key(label: str, **style: Any) -> Any:
    """An entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)


def save(figure: Any, out: Path) -> None:
    """Write ``figure`` into the file ``out``; its ending chooses the format.

    Raises:
        PlotError: there is no such format, or matplotlib cannot draw. protocols.whole_file.WriteError: it cannot be written.
    """
    made, kind = BytesIO(), out.suffix[1:].lower()
    if out.is_dir() or kind not in figure.canvas.get_supported_filetypes():
        raise PlotError(f"--out {out}: give a file that ends in .png, .svg or .pdf")
    try:
        if figure.get_layout_engine() is None:
            figure.tight_layout()
        figure.savefig(made, format=kind, dpi=160, facecolor="white")
    except Exception as error:
        raise PlotError(f"--out {out}: {_SETTINGS} ({error})") from None
    write_whole(out, made.getvalue())
