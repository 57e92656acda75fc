"""A moment of a flight as a picture on a terminal: figures, a map and a table of the drones."""

import math
from typing import TextIO

from rich.console import ConsoleDimensions, Group
from rich.live import Live
from rich.text import Text

from rsc_swarm.show.field_map import LEGEND, FieldMap
from rsc_swarm.show.line import late, passed, swaps
from rsc_swarm.show.render import console
from world.outlets.snapshot import AgentRow, Snapshot

_HEAD_LINES = 6  # and the line that explains the columns
_MAP_LINES = 16  # at most; and its legend
_GOOD_MAP_LINES, _LEAST_MAP_LINES = 8, 5  # a smaller one says nothing
_WIDEST = 120  # columns of the map
_ONE_COLUMN = 20  # more drones than this are shown in two columns
_HEADING = f"{'agent':>5} {'slot':>4} {'m/s':>4} {'near m':>6} {'edge':>5} {'hear':>4} {'bad':>3}"
_FOOTER = "near: to anything; edge: off its length; hear: drones heard; bad: frames refused"


class Screen:
    """The part of a terminal that shows one flight. No threads: it is drawn when it is told to, and at no other time."""

    def __init__(self, title: str, stream: TextIO) -> None:
        self._title, self._console, self._map = title, console(stream), FieldMap()
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._live.start()

    def show(self, snapshot: Snapshot) -> None:
        """Show this moment."""
        self._live.update(picture(self._title, snapshot, self._console.size, self._map), refresh=True)

    def doing(self, text: str) -> None:
        """What is being done before there is a flight to see."""
        title = Text(self._title, "bold", no_wrap=True, overflow="ellipsis")
        self._live.update(Group(title, Text(f"{text}...")), refresh=True)

    def say(self, text: str) -> None:
        """One line above it."""
        self._console.print(Text(text))

    def close(self) -> None:
        """Leave the terminal as it was."""
        self._live.stop()


def picture(title: str, snapshot: Snapshot, size: ConsoleDimensions, field: FieldMap) -> Group:
    """One moment as a picture that fits into ``size``: figures, the ``field`` if there is room for it, and the drones."""
    frames = snapshot.frames
    lost = frames["partition"] + frames["burst"] + frames["loss"]
    share = lost / max(1, lost + frames["delivered"])
    head = [
        Text.assemble((title, "bold"), no_wrap=True, overflow="ellipsis"),
        Text(
            f"t {snapshot.time_s:6.2f} s   tick {snapshot.tick:5d}   "
            f"{snapshot.real_time_factor:5.1f} x real time{passed(snapshot, '   ')}{late(snapshot)}",
            no_wrap=True,
        ),
        Text(
            f"frames sent {frames['sent']:,}  heard {frames['delivered']:,}  lost {100 * share:.0f} %   "
            f"swaps proposed {snapshot.swaps['proposed']}, made {swaps(snapshot)}",
            no_wrap=True,
        ),
    ]
    foot = Text(_FOOTER, style="dim", no_wrap=True, overflow="ellipsis")
    left = size.height - _HEAD_LINES
    lines = _map_lines(snapshot, left)
    drawn = field.draw(snapshot, min(size.width - 1, _WIDEST), lines) if lines >= _LEAST_MAP_LINES else None
    if drawn is None:
        return Group(*head, Text(), *_table(snapshot, left - 1), foot)
    return Group(*head, Text(), drawn, LEGEND, *_table(snapshot, left - 2 - lines), foot)


def _map_lines(snapshot: Snapshot, left: int) -> int:
    """How many of the lines ``left`` the map gets: what the table of all drones leaves, or else half."""
    beside = left - 2 - _table_lines(snapshot)
    return min(_MAP_LINES, beside if beside >= _GOOD_MAP_LINES else left // 2 - 2)


def _columns(snapshot: Snapshot) -> int:
    return 1 if len(snapshot.agents) <= _ONE_COLUMN else 2


def _table_lines(snapshot: Snapshot) -> int:
    """So many lines has the table of all drones."""
    return 1 - (-len(snapshot.agents) // _columns(snapshot))


def _table(snapshot: Snapshot, lines: int) -> list[Text]:
    """The drones in one or two columns, as many as fit under the heading."""
    columns = _columns(snapshot)
    needed = -(-len(snapshot.agents) // columns)
    shown = needed if needed <= lines - 1 else max(1, lines - 2)
    table = [Text("  ".join([_HEADING] * columns), style="dim", no_wrap=True)]
    for index in range(shown):
        row = Text(no_wrap=True)
        for column in range(columns):
            agent = index + column * shown
            if agent < len(snapshot.agents):
                row.append("  " if column else "").append_text(_cell(snapshot.agents[agent]))
        table.append(row)
    hidden = len(snapshot.agents) - shown * columns
    if hidden > 0:
        table.append(Text(f"and {hidden} more: make the window taller to see them", style="dim"))
    return table


def _cell(row: AgentRow) -> Text:
    """One drone, as wide as the heading."""
    if row.state == "lost":
        return Text(f"{row.agent:>5} {'lost':>4}".ljust(len(_HEADING)), style="red")
    text = Text()
    text.append(f"{row.agent:>5} {row.slot:>4} {row.speed_mps:4.1f} ")
    near = "-" if math.isinf(row.nearest_m) else f"{min(row.nearest_m, 999.0):.2f}"
    text.append(f"{near:>6}", "red" if row.nearest_m < 1.0 else "")
    edge = 100 * row.edge_error
    text.append(f" {min(edge, 999):4.0f}%", "green" if edge < 10 else "yellow")
    text.append(f" {row.heard:>4} ")
    text.append(f"{min(row.rejected, 999):>3}", "red" if row.rejected else "")
    if row.state == "frozen":
        text.stylize("reverse")
    return text
