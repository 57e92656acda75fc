"""The slot protocol endpoints (protocols.swap) of the hosted drones, attended only when there is something to attend to.

Almost always nothing changes: every digest heard equals one's own and no note says more. agent.cycle tells which rows have
news; only those run their `SlotParty`.
"""

import numpy as np
from numpy.typing import NDArray

from agent.desk import Views, Work
from protocols.frames import Frames
from protocols.mission import TICK_S, Mission
from protocols.swap import SlotNote, SlotParty, Stance, SwapRules
from protocols.trigger import NOBODY
from protocols.versioned import VersionedParty


def make_party(mission: Mission, me: int, initial: list[int], boot: int) -> SlotParty | VersionedParty:
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


class Parties:
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
        self.party = [
            make_party(mission, int(agent), self._initial[row], boot) for row, agent in enumerate(me)
        ]
        self.changed: list[int] = []
        self._busy = boot > 0  # whether any party was busy when last looked at
        for row in range(len(me)):
            self._refresh(row)

    def restart(self, row: int, boot: int) -> None:
        """The drone of this row lost its memory."""
        self._busy = True
        self.party[row] = make_party(self._mission, int(self._me[row]), self._initial[row], boot)
        self._refresh(row)

    def _refresh(self, row: int) -> bool:
        """Copy the party's view into the arrays; True if it changed."""
        party, views = self.party[row], self._views
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
            party, partner, vacated = self.party[row], int(work.partner[row]), int(work.vacated[row])
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
            note = self.party[row].note(tick)
            if not (note.quiet and note.settled):
                notes[first + row] = note
                frames.loud[first + row] = 1
            self._refresh(row)
        self._busy = bool(self._views.busy.any())
