"""What an operator sees of a fleet: a table on a terminal, lines elsewhere; and the keys that are pressed."""

import sys
from contextlib import suppress
from types import TracebackType
from typing import Self

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from agent.air.pilot import Phase
from protocols.wire.operator import Order
from rsc_swarm.air.desk import Desk
from rsc_swarm.air.station import Station
from rsc_swarm.flight.ranges import written
from rsc_swarm.show.keyboard import Keyboard
from rsc_swarm.show.render import console

# What counts most first, and how many letters of a terminal each takes.
_HEADINGS = {
    "drone": 6, "phase": 7, "x m": 7, "y m": 7, "z m": 6, "battery": 8,
    "age ms": 7, "clock ms": 9, "hears": 6, "slot": 5, "missed": 7,
}  # fmt: skip
_WIDE = 80
_REDRAW_S = 0.25
_RED_S = 2.0
_MOST_COMPLAINTS = 6
_GIVEN_UP = (Phase.HOLD, Phase.LAND, Phase.DEAD)


def table(station: Station, now: float, width: int = _WIDE) -> Table:
    """Every drone, a row each; in a narrow terminal what counts most."""
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    fits = [sum(list(_HEADINGS.values())[: 1 + column]) <= 1 + width for column in range(len(_HEADINGS))]
    headings = list(_HEADINGS)[: max(1, sum(fits))]
    for heading in headings:
        shown.add_column(heading, justify="left" if heading == "phase" else "right", no_wrap=True)
    lost, known = set(station.lost(now)), station.contacts.known()
    for drone in range(station.plan.mission.agents):
        account, contact = station.accounts.get(drone), known.get(drone)
        if drone in lost or account is None or contact is None:
            shown.add_row(str(drone), Text("not heard", "red"))
            continue
        beacon = contact.beacon
        clock = "" if account.clock_ms is None else f"{account.clock_ms:.0f}"
        told = (
            str(drone), account.phase, *(f"{metres:.2f}" for metres in beacon.p), f"{beacon.battery} %", f"{beacon.age_ms}",
            clock, f"{len(account.heard)}", f"{account.slot}", f"{account.missed}",
        )  # fmt: skip
        shown.add_row(*told[: len(headings)])
    return shown


def order_text(station: Station) -> str:
    """What is ordered."""
    ordered = "" if station.ordered is Order.NONE else f"ordered: {station.ordered}"
    return f"{ordered}; leaving when all are down" if station.leaving and ordered else ordered


def troubles_text(station: Station, now: float) -> Text:
    """Whether preflight is green, or what speaks against flying; in flight, who does not fly on and why."""
    red = station.red(now)
    if station.in_flight(now):
        red += _who_gave_up(station, now)
    elif not red:
        return Text("preflight is green", "green")
    more = len(red) - _MOST_COMPLAINTS
    return Text("\n".join(red[:_MOST_COMPLAINTS] + ([f"and {more} more"] if more > 0 else [])), "red")


def _who_gave_up(station: Station, now: float) -> list[str]:
    """Who does not fly on, and why; those together that have the same to say."""
    same: dict[str, list[int]] = {}
    for drone, phase in station.phases(now).items():
        if phase in _GIVEN_UP:
            same.setdefault(f"{phase}, {'; '.join(station.accounts[drone].reasons)}", []).append(drone)
    return [f"drone{'s' if drones[1:] else ''} {written(drones)}: {told}" for told, drones in same.items()]


class FleetView:
    """The table, kept up to date within its ``with`` block, and the desk; `attend` is as rsc_swarm.air.tower wants it."""

    def __init__(self, title: str, keys: bool) -> None:
        self._title, self._desk, self._keyboard = title, Desk(), Keyboard(keys)
        self._keys_wanted = keys
        self._console = console(sys.stderr)
        draws = self._console.is_terminal and not self._console.is_dumb_terminal
        self._live = Live(console=self._console, auto_refresh=False) if draws else None
        self._gone = False
        self._drawn = 0.0
        self._told = _Told()

    def say(self, text: str) -> None:
        """One line above the table."""
        self._console.print(Text(text))

    def attend(self, station: Station, utc_us: int, now: float) -> bool:
        """Draw, and do what was typed; whether to go on. A terminal that is gone is an operator who leaves."""
        keys = self._keyboard.pressed(now)
        go_on = keys is not None and not self._gone
        for key in keys or ():
            go_on = self._desk.press(key, station, utc_us, now) and go_on
        if self._gone:
            return False
        try:
            if self._live and now - self._drawn >= _REDRAW_S:
                self._drawn = now
                self._live.update(self._picture(station, now), refresh=True)
            elif not self._live:
                for line in self._told.lines(station, self._desk, now):
                    self.say(line)
        except OSError:
            self._gone = True
        return go_on

    def _picture(self, station: Station, now: float) -> Group:
        """What is typed comes first, so that a low terminal shows it."""
        desk = [Text(f"> {self._desk.typed}")] if self._keyboard.here else []
        told = [Text(self._desk.answer, "dim"), Text(order_text(station), "bold")]
        return Group(
            *desk,
            *filter(None, told),
            troubles_text(station, now),
            Text(self._title, "bold", no_wrap=True, overflow="ellipsis"),
            table(station, now, self._console.width),
        )

    def __enter__(self) -> Self:
        self._keyboard.__enter__()
        if self._keys_wanted and not self._keyboard.here:
            self.say(
                "no terminal to type at: give orders with --do, or at a terminal; Ctrl-C or SIGTERM lands all"
            )
        if self._live:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live:
            with suppress(OSError):
                self._live.stop()
        self._keyboard.__exit__(kind, error, trace)


class _Told:
    """What lines have told of a fleet so far."""

    def __init__(self) -> None:
        self._events, self._text, self._red, self._red_at = 0, "", "", -_RED_S

    def lines(self, station: Station, desk: Desk, now: float) -> list[str]:
        """What has changed since. What speaks against flying may change all the time: not more often than it can be read."""
        lines = [
            f"drone {drone}: {phase}" + (f" ({'; '.join(why)})" if why else "")
            for _, drone, phase, why in station.events[self._events :]
        ]
        self._events = len(station.events)
        red = troubles_text(station, now).plain
        if red != self._red and now - self._red_at >= _RED_S:
            self._red, self._red_at = red, now
            lines += red.splitlines()
        text = desk.answer or order_text(station)
        if text != self._text:
            self._text = text
            lines += [text] if text else []
        return lines
