"""How long the world waits for whom, in lockstep. No clock of its own: all times are the world's running time [s].

Silence has an end (`PATIENCE_S`, `WATCHED_S`). And so has lateness: the time in which one drone alone was awaited, while all
others had answered, may come to as much as all other time of the flight, and `GRACE_S` more. So no drone, however it spreads its
lateness, makes a flight take more than twice its time and that grace. One wait counts for no more than `LONGEST_S`, so that a
pause costs a drone nothing that matters.
"""

from collections.abc import Set as AbstractSet

PATIENCE_S = 90.0  # for one answer: longer than a pause that nobody told the world of,
WATCHED_S = 20.0  # or, where it would have been told, longer than a machine lets a process wait,
TURN_S = 0.2  # and than it takes to give so many processes their turn
GRACE_S = 5.0
LONGEST_S = 1.0
_ODD = 0.01  # of it


class Patience:
    """With each of N drones."""

    def __init__(self, agents: int, watched: bool = False) -> None:
        """watched: whether a process is stopped is known."""
        self._patience_s = max(WATCHED_S, TURN_S * agents) if watched else PATIENCE_S
        self._since = [0.0] * agents  # it is awaited
        self._alone = [0.0] * agents  # how long it was awaited alone, all together
        self._late = [0.0] * agents  # the same, no wait counting for more than it may
        self._last: int | None = None  # awaited alone now,
        self._last_since = 0.0  # since then
        self._in_company = False

    def begin(self, waiting: AbstractSet[int], in_company: bool, now: float) -> None:
        """A wait begins. in_company: it is not one drone alone that flies."""
        self._in_company = in_company
        for agent in waiting:
            self._since[agent] = now
        self.left(waiting, now)

    def left(self, waiting: AbstractSet[int], now: float) -> None:
        """So few are still awaited: one, or none."""
        if self._last is not None:
            waited = now - self._last_since
            self._alone[self._last] += waited
            self._late[self._last] += min(waited, LONGEST_S)
            self._last = None
        if len(waiting) == 1 and self._in_company:
            (self._last,) = waiting
            self._last_since = now

    def is_odd(self, agent: int, now: float) -> bool:
        """Whether it has been awaited for so long that its process may be stopped; to ask the system costs more than a tick."""
        return now - self._since[agent] > _ODD * self._patience_s

    def pause(self, agent: int, now: float) -> None:
        """The process of this drone is known to be stopped: the wait for it begins anew when it goes on."""
        self._since[agent] = now
        if agent == self._last:
            self._alone[agent] += now - self._last_since
            self._last_since = now

    def over(self, agent: int, now: float, flown_s: float) -> str | None:
        """Why this drone, which is awaited, is awaited no longer; ``flown_s`` of running time after the flight began."""
        if now - self._since[agent] > self._patience_s:
            return f"it has not answered for {self._patience_s:g} s"
        waited = now - self._last_since if agent == self._last else 0.0
        late = self._late[agent] + min(waited, LONGEST_S)
        if late > GRACE_S + flown_s - self._alone[agent] - waited:
            return f"it answered late: all others were kept waiting for {late:.1f} s"
        return None
