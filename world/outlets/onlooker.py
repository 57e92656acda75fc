"""Who looks on while a flight lasts, and may lay hands on it: the live page's end, or nobody."""

from typing import Protocol

from world.director import Director


class Onlooker(Protocol):
    """Whoever flies asks it between any two ticks, before the first and after the last."""

    def attend(self, director: Director) -> float:
        """Look at the flight, and let happen what hands want; never wait.

        Returns:
            Seconds to wait before the next tick, at most a twentieth; then it is asked again. 0: fly on.
        """


class Nobody:
    """Nobody looks on."""

    def attend(self, director: Director) -> float:
        return 0.0
