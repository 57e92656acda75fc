"""The one seam between a drone and where it flies: a body, a radio and a clock.

A drone (agent.process) knows nothing else of the place it is in. In a simulated world all three are one relay
(agent.body.relayed); on the air they are three: an autopilot, peers, a clock that all share. What a drone wants (the fourth port,
`agent.policy.Policy`) is behind AgentCore.

All speak of the plane in which the swarm flies, in the common local frame: metres, m/s, m/s²; x forward, y left. Height and yaw
a body keeps by itself.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from protocols.wire.heard import pack_heard
from protocols.wire.sensed import Sensed
from protocols.wire.status import AgentStatus


class Body(Protocol):
    """What flies, and what it senses."""

    sensed: Sensed
    """One row: its own motion, and the neighbours and obstacles for which it has sensors; the same arrays every time."""

    def sense(self) -> None:
        """Bring ``sensed`` up to now."""

    def fly(self, ax: float, ay: float) -> None:
        """Accelerate by this until the next tick.

        A body that is led by places and speeds (an autopilot) makes them of this and of what it senses.
        """


class Heard(NamedTuple):
    """``frames`` frames, as they lie in ``data`` from ``at`` to ``end`` (protocols.wire.heard), each behind its source as far as
    the radio knows it; how old a frame is it says itself. It is quickest if ``data`` is the same array every time.
    """

    data: NDArray[np.uint8]
    at: int
    end: int
    frames: int


def heard_of(said: Sequence[tuple[int, bytes]], room: NDArray[np.uint8] | None = None) -> Heard:
    """What is heard where each of ``said`` is a source and its frame; it lies in ``room`` if there is enough."""
    packed = pack_heard(said)
    size = len(packed)
    if room is None or size > len(room):
        room = np.zeros(size, np.uint8)
    room[:size] = np.frombuffer(packed, np.uint8)
    return Heard(room, 0, size, len(said))


class Radio(Protocol):
    """What brings frames to a drone and carries its own."""

    def hear(self) -> Heard:
        """The frames that came since the last tick; anything may be in them."""

    def say(self, frame: bytes) -> None:
        """Broadcast a frame to whoever is in range."""

    def report(self, slot: int, status: AgentStatus | None) -> None:
        """Tell the ground, once a tick, which slot the drone holds and, when there is news, its account of itself."""


class Clock(Protocol):
    """When a drone acts."""

    def ticks(self) -> Iterator[int]:
        """The ticks of the flight as they come, until it is over. A tick's work is done when the next one is asked for."""
