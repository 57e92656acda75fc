"""What a drone has heard of its operator: the word that stands, since when he is silent, what is new of what he says. Pure."""

import math

from protocols.wire.operator import Order, Word

_AROUND = 1 << 32  # numbers begin anew
_MORE = 1000  # than anybody orders: so far behind is only who was started by another clock


class Commands:
    """``patience_s``: who was silent for longer may be another operator, whose clock was set back meanwhile: his numbers, which
    count from the time at which he started, are smaller then.

    Attributes: word: that stands; None before the first.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self.word: Word | None = None
        self._heard_at = -math.inf

    def hear(self, word: Word, now: float) -> Order | None:
        """What is ordered by it; None: nothing new. The first that is heard may be of long ago, and orders nothing."""
        before, silent_s = self.word, now - self._heard_at
        ahead = 0 if before is None else (word.number - before.number + _AROUND // 2) % _AROUND - _AROUND // 2
        other = before is None or (ahead < -_MORE and silent_s > self._patience_s)
        if ahead < 0 and not other:
            return None  # overtaken
        self._heard_at = now
        if ahead > 0 or other:
            self.word = word
        return word.order if ahead > 0 else None

    def silent_s(self, now: float) -> float | None:
        """Since something was heard; None: never."""
        return None if self.word is None else now - self._heard_at
