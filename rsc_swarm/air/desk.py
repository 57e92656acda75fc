"""The operator's desk: what is typed there, and what came of it. No input or output."""

from protocols.wire.operator import Order
from rsc_swarm.air.station import OrderError, Station

_AT_ONCE = {"L": Order.LAND, "A": Order.ABORT, "K": Order.KILL}
_WORDS = {order.value: order for order in Order if order is not Order.NONE}
_KNOWN = f"preflight, {', '.join(_WORDS)}, quit"
_LONGEST = 40


class Desk:
    """Words go with Enter; three capitals act at once, whatever is typed: L land, A abort, K kill.

    But behind a capital they are letters: who types in capitals has Caps Lock on, and TAKEOFF has an A and a K.

    Attributes:
        typed: so far. answer: to what was typed last, where it was no order that is carried out; one line.
    """

    def __init__(self) -> None:
        self.typed = ""
        self.answer = f"words, with Enter: {_KNOWN}; at once: L land, A abort, K kill"

    def press(self, key: str, station: Station, utc_us: int, now: float) -> bool:
        """A key is pressed; whether the operator stays."""
        if key in _AT_ONCE and not self.typed.isupper():
            self.typed = ""
            self._order(_AT_ONCE[key], station, utc_us, now)
        elif key in ("\r", "\n"):
            word, self.typed = self.typed.strip().lower(), ""
            return self._enter(word, station, utc_us, now)
        elif key in ("\x7f", "\b"):
            self.typed = self.typed[:-1]
        elif key == "\x15":  # Ctrl-U
            self.typed = ""
        elif key.isprintable():
            self.typed = (self.typed + key)[:_LONGEST]
        return True

    def _enter(self, word: str, station: Station, utc_us: int, now: float) -> bool:
        if word == "quit":
            return False
        if word == "preflight":
            self.answer = "; ".join(station.red(now)) or "preflight is green"
        elif word in _WORDS:
            self._order(_WORDS[word], station, utc_us, now)
        elif word:
            self.answer = f"{word!r} is no order; known: {_KNOWN}"
        return True

    def _order(self, order: Order, station: Station, utc_us: int, now: float) -> None:
        try:
            station.order(order, utc_us, now)
            self.answer = ""
        except OrderError as error:
            self.answer = str(error)
