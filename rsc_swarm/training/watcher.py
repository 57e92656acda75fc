"""Who is told how a training goes."""

from typing import Protocol

from rsc_swarm.training.config import TrainingConfig

Scalars = dict[str, float]


class Watcher(Protocol):
    """Is told how a training goes."""

    def begin(self, config: TrainingConfig, curve: list[Scalars]) -> None:
        """It begins, or goes on after the epochs of ``curve``."""

    def step(self, share: float) -> None:
        """This share of the present epoch is done."""

    def kept(self, updates: int) -> None:
        """So much of the present epoch is on disk: its flights, and so many of its updates."""

    def epoch(self, scalars: Scalars) -> None:
        """An epoch is done."""


class Nobody(Watcher):
    """Is told, and says nothing."""
