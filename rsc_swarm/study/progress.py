"""How far an evaluation is."""

from statistics import fmean
from typing import Protocol

from rsc_swarm.study.evaluate import Watcher
from rsc_swarm.study.workers import Flight

TICKS_GUESS = 0.75  # of the ticks a flight may take, until some have been flown


class Meter(Protocol):
    """Where progress is shown: rsc_swarm.show.progress.Meter on a terminal."""

    def due(self) -> bool:
        """Whether it is time to draw again."""

    def draw(self, done: float, text: str) -> None:
        """So much of the whole, 0 to 1, is done."""


class Flights(Watcher):
    """Counts the flights of one evaluation and shows them on a meter."""

    def __init__(
        self, ticks_guess: float, meter: Meter, label: str = "", before: float = 0.0, weight: float = 1.0
    ) -> None:
        """Count for one evaluation.

        Args:
            ticks_guess: how long a flight may take, until some have been flown.
            label: stands before the count.
            before, weight: the share of all work that was done before this evaluation, and that it is.
        """
        self.flights: list[Flight] = []
        self._known, self._missing, self._ticks, self._guess = 0, 0, 0, ticks_guess
        self._meter, self._label, self._before, self._weight = meter, label, before, weight

    def begin(self, known: list[Flight], missing: int) -> None:
        self.flights, self._known, self._missing = list(known), len(known), missing

    def ticks(self, flown: int) -> None:
        self._ticks += flown
        if self._meter.due():
            self._meter.draw(self._before + self._weight * self._share(), self.said())

    def flight(self, flight: Flight) -> None:
        self.flights.append(flight)

    def said(self) -> str:
        """The count as a phrase."""
        failed = sum(not flight.outcome.success for flight in self.flights)
        total = self._known + self._missing
        return f"{self._label}{len(self.flights)} of {total} flights, {failed or 'none'} failed"

    def _share(self) -> float:
        """The share of the flights that is done, by ticks: flights end in bunches."""
        fresh = [flight.outcome.ticks for flight in self.flights[self._known :]]
        length = fmean(fresh) if fresh else self._guess
        return min(1.0, self._ticks / max(1.0, length * self._missing))
