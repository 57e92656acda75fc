"""The slot protocol endpoints (protocols.swap) of the hosted drones, attended only when there is something to attend to.

Almost always nothing changes: every digest heard equals one's own and no note says more. agent.cycle tells which rows have
news; only those run their `SlotParty`.
"""

import numpy as np
from numpy.typing import NDArray

from protocols.frames import Frames
from protocols.mission import TICK_S, Mission
from protocols.swap import SlotNote, SlotParty, Stance, SwapRules
from protocols.trigger import NOBODY


def _make_party(mission: Mission, me: int, initial: list[int], boot: int) -> SlotParty:
    spec = mission.swap
    answer = round(spec.answer_s / TICK_S)
    rules = SwapRules(
        cooldown_ticks=round(spec.cooldown_s / TICK_S), answer_ticks=answer, lock_ticks=2 * answer, retry_ticks=10
    )
    return SlotParty(me, initial, rules, nonce=boot, amnesiac=boot > 0)


class Parties:
    """One `SlotParty` per hosted drone, and their views as arrays for the kernels.

    slot_of, occupant: (A, N) each drone's view, agent -> slot and slot -> agent. slot: (A,) its own slot. digest: (A,) of its
    swap set. busy: (A,) whether its protocol has business of its own. changed: rows whose view changed this tick.
    """

    def __init__(self, mission: Mission, me: NDArray[np.int64], initial_slots: NDArray[np.int16], boot: int) -> None:
        self._mission, self._me = mission, me
        self._initial = [[int(slot) for slot in row] for row in initial_slots]
        self.party = [_make_party(mission, int(agent), self._initial[row], boot) for row, agent in enumerate(me)]
        rows = len(me)
        self.slot_of = np.zeros((rows, mission.agents), np.int64)
        self.occupant = np.zeros((rows, mission.agents), np.int64)
        self.slot = np.zeros(rows, np.int64)
        self.digest = np.zeros(rows, np.uint64)
        self.busy = np.zeros(rows, np.bool_)
        self.changed: list[int] = []
        for row in range(rows):
            self._refresh(row)

    def restart(self, row: int, boot: int) -> None:
        """The drone of this row lost its memory."""
        self.party[row] = _make_party(self._mission, int(self._me[row]), self._initial[row], boot)
        self._refresh(row)

    def _refresh(self, row: int) -> bool:
        """Copy the party's view into the arrays; True if it changed."""
        party = self.party[row]
        self.busy[row] = not party.quiet
        if self.digest[row] == party.digest:
            return False
        self.digest[row] = party.digest
        self.slot_of[row] = party.slot_of
        self.occupant[row, self.slot_of[row]] = np.arange(len(party.slot_of))
        self.slot[row] = party.slot
        return True

    def step(
        self,
        tick: int,
        news: NDArray[np.bool_],
        frames: Frames,
        notes: list[object],
        inbox_start: NDArray[np.int64],
        inbox: NDArray[np.int64],
        partner: NDArray[np.int64],
        vacated: NDArray[np.int64],
    ) -> bool:
        """For rows with news: hear the notes, watch the time-outs, act on the triggers. True if any view changed."""
        for row in np.flatnonzero(news):
            party = self.party[row]
            for index in inbox[inbox_start[row] : inbox_start[row + 1]]:
                note = notes[index] if frames.loud[index] else SlotNote(int(frames.digest[index]), True)
                assert isinstance(note, SlotNote)
                party.hear(note, int(frames.sender[index]), tick)
            party.advance(tick)
            if vacated[row] != NOBODY and party.stance is Stance.IDLE:
                party.vacate(int(vacated[row]), tick)
            elif partner[row] != NOBODY and party.ready(tick):
                party.propose(int(partner[row]), tick)
            if self._refresh(row):
                self.changed.append(int(row))
        return bool(self.changed)

    def write_notes(self, tick: int, sent: NDArray[np.bool_], frames: Frames, notes: list[object], first: int) -> None:
        """Where a sending row's note says more than its digest, put it into its frame row."""
        if not self.busy.any():
            return
        for row in np.flatnonzero(sent & self.busy):
            note = self.party[row].note(tick)
            if not (note.quiet and note.settled):
                notes[first + row] = note
                frames.loud[first + row] = 1
            self._refresh(row)
