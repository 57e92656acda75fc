"""The numbers of the swap protocol: its settings, and what a party counts."""

from __future__ import annotations

from dataclasses import dataclass

from protocols.slots.history import Swap
from protocols.slots.notes import MAX_OPS


@dataclass(frozen=True)
class SwapRules:
    """Times in ticks of the caller's clock, amounts per note."""

    cooldown_ticks: int = 100
    """After a commit, before either party agrees to another swap."""
    answer_ticks: int = 50
    """A proposal waits this long for its answer."""
    lock_ticks: int = 100
    """A promise waits this long for the commit: longer than `answer_ticks` and a frame's delay together."""
    retry_ticks: int = 10
    """After a proposal came to nothing, before the next."""
    repair_per_frame: int = 16
    """Swaps in one note."""
    repair_frames: int = 4
    """Notes that go on carrying swaps after the last unlike digest was heard."""
    ack_frames: int = 4
    """Notes that go on saying who has had the swaps after the last news of it. 0: none, and no folding."""
    ack_ticks: int = 5
    """While swaps are open, nobody is silent about who has had them for longer than this."""
    history_max: int = 4096
    """Who knows as many swaps as this agrees to no more."""
    leaders: tuple[int, ...] = ()
    """leaders[slot]: the slot above it, which only its occupant may take from the dead. Empty: anyone may take any."""

    def __post_init__(self) -> None:
        if not 1 <= self.repair_per_frame <= MAX_OPS:
            raise ValueError(f"a note holds 1 to {MAX_OPS} swaps, not {self.repair_per_frame}")
        if self.repair_frames < 1:
            raise ValueError("repair takes a frame at least")

    def allows(self, op: Swap) -> bool:
        """False for the taking of a slot by one who does not follow it."""
        return not (op.taken and self.leaders) or self.leaders[op.slot_a] == op.slot_b


@dataclass
class SwapCounts:
    """What one party went through."""

    proposed: int = 0
    committed: int = 0
    """Swaps proposed here and committed."""
    accepted: int = 0
    """Promises given here."""
    refused: int = 0
    """Proposals from here that were refused."""
    withdrawn: int = 0
    """Proposals from here that were overtaken by another swap or by a crossing proposal."""
    timed_out: int = 0
    """Proposals and promises that waited in vain."""
    vacated: int = 0
    """Slots of dead agents taken here."""
    undone: int = 0
    """Swaps acted on here that a later merge turned off."""
    unsealed: int = 0
    """Swaps and acceptances heard here that lacked a seal, or could not be."""
