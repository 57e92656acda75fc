"""What a party of the swap protocol (protocols.slots.agreement) is bound to, and what it may do then."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from protocols.slots.history import Swap


class Stance(Enum):
    """What a party is bound to."""

    IDLE = "idle"
    PROPOSING = "waiting for the answer to a proposal"
    PROMISED = "promised to another's proposal"
    AMNESIAC = "amnesiac"


TURNS: dict[tuple[Stance, str], Stance] = {
    (Stance.IDLE, "propose"): Stance.PROPOSING,
    (Stance.IDLE, "vacate"): Stance.IDLE,
    (Stance.IDLE, "accept"): Stance.PROMISED,
    (Stance.PROPOSING, "commit"): Stance.IDLE,
    (Stance.PROPOSING, "give up"): Stance.IDLE,
    (Stance.PROMISED, "see commit"): Stance.IDLE,
    (Stance.PROMISED, "let go"): Stance.IDLE,
    (Stance.AMNESIAC, "vacate"): Stance.AMNESIAC,
    (Stance.AMNESIAC, "join"): Stance.IDLE,
}


class IllegalSwap(RuntimeError):
    """The party cannot do this now. Nothing changed."""


class Deal(NamedTuple):
    """The one swap a party is engaged in, as the proposer or as its partner."""

    proposer: int
    nonce: int
    slot: int
    partner: int
    partner_slot: int
    clock: int  # all that the proposer knew when it asked
    counter: int  # named by the partner; 0: not yet
    seal: bytes  # of the partner; empty: not yet
    since: int  # tick of the first proposal, if it was renewed
    until: int  # tick

    def swap(self, counter: int) -> Swap:
        """What it comes to."""
        return Swap(counter, self.proposer, self.nonce, self.slot, self.partner, self.partner_slot)
