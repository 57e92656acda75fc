"""Draws that depend on the seed alone.

Hypothesis itself now and then draws a number that stands in the source of some module that happens to be loaded: another
checkout, an installed package or a worker elsewhere would draw other missions from the same seed.
"""

from typing import Any

from hypothesis.internal.conjecture.providers import AVAILABLE_PROVIDERS, HypothesisProvider

STEADY = "rsc-swarm"  #: the backend, as Hypothesis' settings name it


class Steady(HypothesisProvider):
    """As Hypothesis draws, but for those numbers."""

    def _maybe_draw_constant(self, *_: Any, **__: Any) -> None:
        return None


AVAILABLE_PROVIDERS[STEADY] = f"{__name__}.{Steady.__name__}"
