"""What an operator sees of a fleet, and the keys that are pressed: a table on a terminal, nothing elsewhere.

Words go with Enter; three capitals act at once: L land, A abort, K kill.
"""

import select
import sys
import termios
import tty
from types import TracebackType
from typing import Any, Self

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from protocols.wire.operator import Order
from rsc_swarm.air.station import OrderError, Station
from rsc_swarm.show.render import console

_AT_ONCE = {"L": Order.LAND, "A": Order.ABORT, "K": Order.KILL}
_WORDS = {order.value: order for order in Order if order is not Order.NONE}
_REDRAW_S = 0.25
_MOST_COMPLAINTS = 6


def table(station: Station, now: float) -> Table:
    """Every drone, a row each."""
    shown = Table(box=None, pad_edge=False)
    for heading in (
        "drone",
        "phase",
        "height m",
        "battery",
        "position ms",
        "clock ms",
        "hears",
        "slot",
        "missed",
        "why",
    ):
        shown.add_column(heading, justify="left" if heading in ("phase", "why") else "right")
    lost, known = set(station.lost(now)), station.contacts.known()
    for drone in range(station.plan.mission.agents):
        account, contact = station.accounts.get(drone), known.get(drone)
        if drone in lost or account is None or contact is None:
            shown.add_row(str(drone), Text("not heard", "red"))
            continue
        beacon = contact.beacon
        clock = "" if account.clock_ms is None else f"{account.clock_ms:.0f}"
        shown.add_row(
            str(drone), account.phase, f"{beacon.p[2]:.2f}", f"{beacon.battery} %", f"{beacon.age_ms}", clock,
            f"{len(account.heard)}", f"{account.slot}", f"{account.missed}", "; ".join(account.reasons),
        )  # fmt: skip
    return shown


def preflight_text(station: Station, now: float) -> Text:
    """Whether preflight is green, or what speaks against flying."""
    red = station.red(now)
    if not red:
        return Text("preflight is green", "green")
    more = len(red) - _MOST_COMPLAINTS
    return Text("\n".join(red[:_MOST_COMPLAINTS] + ([f"and {more} more"] if more > 0 else [])), "red")


class FleetView:
    """The table, kept up to date within its ``with`` block, and the keys; `attend` is as rsc_swarm.air.tower wants it."""

    def __init__(self, title: str, keys: bool) -> None:
        self._title, self._typed, self._answer = (
            title,
            "",
            "words: preflight arm takeoff go hold land abort kill quit",
        )
        self._console = console(sys.stderr)
        self._live = (
            Live(console=self._console, auto_refresh=False, transient=False)
            if self._console.is_terminal
            else None
        )
        self._keys = keys and sys.stdin.isatty()
        self._before: list[Any] | None = None
        self._drawn = 0.0

    def say(self, text: str) -> None:
        """One line above the table."""
        self._console.print(Text(text))

    def attend(self, station: Station, utc_us: int, now: float) -> bool:
        """Draw, and do what was typed; whether to go on."""
        go_on = True
        while self._keys and select.select([sys.stdin], [], [], 0)[0]:
            go_on = self._press(sys.stdin.read(1), station, utc_us, now) and go_on
        if self._live and now - self._drawn >= _REDRAW_S:
            self._drawn = now
            parts: list[Text | Table] = [
                Text(self._title, "bold"),
                table(station, now),
                preflight_text(station, now),
            ]
            if self._keys:
                parts += [Text(self._answer, "dim"), Text(f"> {self._typed}")]
            self._live.update(Group(*parts), refresh=True)
        return go_on

    def _press(self, key: str, station: Station, utc_us: int, now: float) -> bool:
        if not self._typed and key in _AT_ONCE:
            self._do(_AT_ONCE[key], station, utc_us, now)
        elif key in ("\r", "\n"):
            word, self._typed = self._typed.strip(), ""
            if word == "quit":
                return False
            if word == "preflight":
                self._answer = "; ".join(station.red(now)) or "preflight is green"
            elif word in _WORDS:
                self._do(_WORDS[word], station, utc_us, now)
            elif word:
                self._answer = f"{word!r} is no order; known: preflight, {', '.join(_WORDS)}, quit"
        elif key == "\x7f":
            self._typed = self._typed[:-1]
        elif key.isprintable():
            self._typed = (self._typed + key)[:40]
        return bool(key)

    def _do(self, order: Order, station: Station, utc_us: int, now: float) -> None:
        try:
            station.order(order, utc_us, now)
            self._answer = f"ordered: {order}"
        except OrderError as error:
            self._answer = str(error)

    def __enter__(self) -> Self:
        if self._keys:
            self._before = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live:
            self._live.stop()
        if self._before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._before)
