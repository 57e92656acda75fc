"""What is made to go wrong with what a drone hears and with its clock, to see what happens then."""

import random
import re
from dataclasses import dataclass, replace

from protocols.errors import SwarmError

_TROUBLE = re.compile(
    r"loss=(?P<loss>0?\.\d+|0|1)|clock=(?P<clock>-?\d+)ms|deaf=(?P<first>\d+(?:\.\d+)?)-(?P<last>\d+(?:\.\d+)?)"
)


class TroubleError(SwarmError, ValueError):
    """Trouble that there is not; one line says what there is."""


@dataclass(frozen=True)
class Trouble:
    """What is made to go wrong, to see what happens then.

    Attributes:
        loss: share of all that is heard that gets lost. clock_us: by which the clock is off.
        deaf: hears nothing from so many to so many seconds after `go`.
    """

    loss: float = 0.0
    clock_us: int = 0
    deaf: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def parse(cls, text: str) -> "Trouble":
        """``loss=0.3,clock=50ms,deaf=3-8``, or some of it.

        Raises:
            TroubleError: something else.
        """
        trouble = cls()
        for word in filter(None, text.split(",")):
            match = _TROUBLE.fullmatch(word)
            if not match:
                raise TroubleError(
                    f"--trouble {text}: {word!r} is none; write loss=0.3, clock=50ms or deaf=3-8, with commas between"
                )
            if match["loss"]:
                trouble = replace(trouble, loss=float(match["loss"]))
            elif match["clock"]:
                trouble = replace(trouble, clock_us=1000 * int(match["clock"]))
            else:
                trouble = replace(trouble, deaf=(float(match["first"]), float(match["last"])))
        return trouble

    def loses(self, flown_s: float) -> bool:
        """Whether what comes now gets lost."""
        return self.deaf[0] <= flown_s < self.deaf[1] or (self.loss > 0 and random.random() < self.loss)
