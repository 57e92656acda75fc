"""The hosted drones' ends of the slot protocol, attended to only when there is news.

Almost always nothing changes: every digest heard equals one's own and no note says more. agent.tick tells which rows have
news; only those run their `SlotEndpoint`.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from agent.radio.air import Air
from agent.tick_arrays import Views, Work
from protocols.dynamics import ticks_of
from protocols.mission.document import Mission
from protocols.slots.agreement import SlotNote, SlotParty, Stance, SwapCounts, SwapRules
from protocols.slots.highest_version import VersionedParty
from protocols.slots.notes import MAX_OPS
from protocols.slots.seals import Seals
from protocols.slots.trigger import NOBODY
from protocols.wire.frames import FIXED, KNOWN_BYTES, MAX_FRAME_BYTES, MAX_KNOWN, RELAYED_BYTES

_NOTE_BYTES, _DEAL_BYTES, _SWAP_BYTES = 13, 180, 158  # of a note without more, none of them ever more

SealsOf = Callable[[int], Seals]  # agent -> its seals


class SlotEndpoint(Protocol):
    """One drone's side of a slot protocol: a state machine that hears notes, says one per frame, and is told the tick."""

    stance: Stance
    counts: SwapCounts

    @property
    def digest(self) -> int:
        """Equal for equal knowledge."""

    @property
    def view(self) -> Sequence[int]:
        """Agent -> slot; to be read before it hears or does more."""

    @property
    def slot(self) -> int:
        """Its own slot."""

    @property
    def quiet(self) -> bool:
        """Whether nothing is under way: then hearing a quiet note of its digest changes nothing."""

    def ready(self, tick: int) -> bool:
        """Whether it may propose now."""

    def propose(self, partner: int, tick: int) -> None:
        """Begin to exchange slots with ``partner``. IllegalSwap if not ready."""

    def may_vacate(self, dead: int) -> bool:
        """Whether it may take that drone's slot now, if that one is dead."""

    def vacate(self, dead: int, tick: int) -> None:
        """Take a dead drone's slot, at once. IllegalSwap if it may not."""

    def hear(self, note: SlotNote, sender: int, tick: int) -> None:
        """A neighbour's note."""

    def advance(self, tick: int) -> None:
        """Let time pass: what has waited too long is given up."""

    def note(self, tick: int) -> SlotNote:
        """What its next frame says. Counts as said."""


def swaps_per_note(agents: int, relays: bool = False) -> int:
    """How many sealed swaps a frame has room for, however much else it carries; ``relays``: relayed means, too."""
    frame = FIXED.itemsize + KNOWN_BYTES * min(agents - 1, MAX_KNOWN) + relays * RELAYED_BYTES
    return min(MAX_OPS, (MAX_FRAME_BYTES - frame - _NOTE_BYTES - _DEAL_BYTES - agents // 8) // _SWAP_BYTES)


def make_endpoint(
    mission: Mission, me: int, initial: list[int], boot: int, seals: Seals, relays: bool = False
) -> SlotEndpoint:
    """The side of drone ``me`` in the mission's protocol; ``relays``: its frames carry relayed means."""
    spec = mission.swap
    answer = mission.answer_ticks
    rules = SwapRules(
        cooldown_ticks=ticks_of(spec.cooldown_s),
        answer_ticks=answer,
        lock_ticks=2 * answer,
        retry_ticks=10,
        repair_per_frame=swaps_per_note(mission.agents, relays),
        leaders=tuple(map(int, mission.layout.parent)),
    )
    party = SlotParty if spec.protocol == "agreed" else VersionedParty
    return party(me, initial, rules, nonce=boot, amnesiac=boot > 0, seals=seals)


class SlotEndpoints:
    """One `SlotEndpoint` per hosted drone, and their views as arrays for the kernels."""

    def __init__(
        self,
        mission: Mission,
        me: NDArray[np.int64],
        initial_slots: NDArray[np.int16],
        views: Views,
        boot: int,
        seals_of: SealsOf,
        relays: bool,
    ) -> None:
        self._seals_of, self._relays = seals_of, relays
        self._mission, self._me, self._views = mission, me, views
        self._initial = initial_slots
        self.endpoint = [self._begin(row, boot) for row in range(len(me))]
        self._all, self._digest = np.arange(mission.agents), [-1] * len(me)  # as they are in `views`
        self._busy = boot > 0  # whether any party was busy when last looked at
        for row in range(len(me)):
            self._refresh(row)

    def _begin(self, row: int, boot: int) -> SlotEndpoint:
        agent, initial = int(self._me[row]), self._initial[row].tolist()
        return make_endpoint(self._mission, agent, initial, boot, self._seals_of(agent), self._relays)

    def restart(self, row: int, boot: int) -> None:
        """The drone of this row lost its memory."""
        self._busy = True
        self.endpoint[row] = self._begin(row, boot)
        self._refresh(row)

    def _refresh(self, row: int) -> bool:
        """Copy the party's view into the arrays; True if it changed."""
        party, views = self.endpoint[row], self._views
        views.busy[row] = not party.quiet
        if self._digest[row] == party.digest:
            return False
        self._digest[row] = views.digest[row] = party.digest
        views.slot_of[row] = party.view
        views.occupant[row, views.slot_of[row]] = self._all
        views.slot[row] = party.slot
        return True

    def step(self, tick: int, work: Work, air: Air) -> tuple[int, ...]:
        """For rows with news: hear the notes, watch the time-outs, act on the triggers; the rows whose view changed."""
        rows, changed = np.flatnonzero(work.news), []
        if not len(rows):
            return ()
        sender = air.frames.sender.data  # quicker to index
        starts, ends = work.inbox_start[rows].tolist(), work.inbox_start[rows + 1].tolist()
        news = zip(
            rows.tolist(), work.partner[rows].tolist(), work.vacated[rows].tolist(), starts, ends, strict=True
        )
        for row, partner, vacated, start, end in news:
            party, heard = self.endpoint[row], work.inbox[start:end]
            for index in heard.tolist():
                party.hear(air.note(index), sender[index], tick)
            party.advance(tick)
            if vacated != NOBODY and party.may_vacate(vacated):
                party.vacate(vacated, tick)
            elif partner != NOBODY and party.ready(tick):
                party.propose(partner, tick)
            if self._refresh(row):
                changed.append(row)
        self._busy = bool(self._views.busy.any())
        return tuple(changed)

    def write_notes(self, tick: int, sent: NDArray[np.bool_], air: Air, first: int) -> None:
        """Put what the sending rows say about slots, where it may be more than their digest, into their frame rows."""
        if not self._busy:
            return
        for row in np.flatnonzero(sent & self._views.busy).tolist():
            party = self.endpoint[row]
            air.put_note(first + row, party.note(tick))
            self._views.busy[row] = not party.quiet
        self._busy = bool(self._views.busy.any())
