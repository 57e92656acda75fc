"""The hosted drones' ends of the slot protocol (protocols.slots.agreement), attended to only when there is news.

Almost always nothing changes: every digest heard equals one's own and no note says more. agent.tick tells which rows have
news; only those run their `SlotParty`.
"""

import numpy as np
from numpy.typing import NDArray

from agent.tick_arrays import Views, Work
from protocols.dynamics import TICK_S
from protocols.mission.document import Mission
from protocols.slots.agreement import SlotNote, SlotParty, Stance, SwapRules
from protocols.slots.highest_version import VersionedParty
from protocols.slots.trigger import NOBODY
from protocols.wire.frames import Frames


def make_endpoint(mission: Mission, me: int, initial: list[int], boot: int) -> SlotParty | VersionedParty:
    spec = mission.swap
    answer = round(spec.answer_s / TICK_S)
    rules = SwapRules(
        cooldown_ticks=round(spec.cooldown_s / TICK_S),
        answer_ticks=answer,
        lock_ticks=2 * answer,
        retry_ticks=10,
    )
    party = SlotParty if spec.protocol == "agreed" else VersionedParty
    return party(me, initial, rules, nonce=boot, amnesiac=boot > 0)


class SlotEndpoints:
    """One `SlotParty` per hosted drone, and their views as arrays for the kernels.

    changed: rows whose view changed this tick.
    """

    def __init__(
        self,
        mission: Mission,
        me: NDArray[np.int64],
        initial_slots: NDArray[np.int16],
        views: Views,
        boot: int,
    ) -> None:
        self._mission, self._me, self._views = mission, me, views
        self._initial = [[int(slot) for slot in row] for row in initial_slots]
        self.endpoint = [
            make_endpoint(mission, int(agent), self._initial[row], boot) for row, agent in enumerate(me)
        ]
        self.changed: list[int] = []
        self._busy = boot > 0  # whether any party was busy when last looked at
        for row in range(len(me)):
            self._refresh(row)

    def restart(self, row: int, boot: int) -> None:
        """The drone of this row lost its memory."""
        self._busy = True
        self.endpoint[row] = make_endpoint(self._mission, int(self._me[row]), self._initial[row], boot)
        self._refresh(row)

    def _refresh(self, row: int) -> bool:
        """Copy the party's view into the arrays; True if it changed."""
        party, views = self.endpoint[row], self._views
        views.busy[row] = not party.quiet
        if views.digest[row] == party.digest:
            return False
        views.digest[row] = party.digest
        views.slot_of[row] = party.slot_of
        views.occupant[row, views.slot_of[row]] = np.arange(len(party.slot_of))
        views.slot[row] = party.slot
        return True

    def step(self, tick: int, work: Work, frames: Frames, notes: list[object]) -> bool:
        """For rows with news: hear the notes, watch the time-outs, act on the triggers. True if any view changed."""
        for row in np.flatnonzero(work.news).tolist():
            party, partner, vacated = self.endpoint[row], int(work.partner[row]), int(work.vacated[row])
            for index in work.inbox[work.inbox_start[row] : work.inbox_start[row + 1]]:
                note = notes[index] if frames.loud[index] else SlotNote(int(frames.digest[index]), True)
                assert isinstance(note, SlotNote)
                party.hear(note, int(frames.sender[index]), tick)
            party.advance(tick)
            if vacated != NOBODY and party.stance is Stance.IDLE:
                party.vacate(vacated, tick)
            elif partner != NOBODY and party.ready(tick):
                party.propose(partner, tick)
            if self._refresh(row):
                self.changed.append(row)
        self._busy = bool(self._views.busy.any())
        return bool(self.changed)

    def write_notes(
        self, tick: int, sent: NDArray[np.bool_], frames: Frames, notes: list[object], first: int
    ) -> None:
        """Where a sending row's note says more than its digest, put it into its frame row."""
        if not self._busy:
            return
        for row in np.flatnonzero(sent & self._views.busy).tolist():
            note = self.endpoint[row].note(tick)
            if not (note.quiet and note.settled):
                notes[first + row] = note
                frames.loud[first + row] = 1
            self._refresh(row)
        self._busy = bool(self._views.busy.any())
