"""The plain rule "highest version wins", to which the swap protocol is compared."""

from __future__ import annotations

import pytest

from protocols.slots.agreement import IllegalSwap, Stance, SwapRules
from protocols.slots.highest_version import VersionedParty

RULES = SwapRules()


def rounds(swarm: list[VersionedParty], count: int) -> None:
    """Each broadcasts once per round, and all hear it."""
    for _ in range(count):
        for speaker in swarm:
            note = speaker.note(0)
            for listener in swarm:
                listener.hear(note, speaker.me, 0)


def swarm_of(n: int) -> list[VersionedParty]:
    return [VersionedParty(agent, range(n), RULES) for agent in range(n)]


def test_the_highest_version_spreads_and_falls_quiet() -> None:
    swarm = swarm_of(4)
    swarm[0].propose(1, tick=0)
    assert not swarm[0].ready(99)
    rounds(swarm, 1)
    assert {party.slot_of for party in swarm} == {(1, 0, 2, 3)}
    rounds(swarm, 6)
    assert all(party.quiet and party.note(9).quiet for party in swarm)


def test_of_two_far_swaps_the_highest_version_loses_one() -> None:
    swarm = swarm_of(4)
    swarm[0].propose(1, tick=0)
    swarm[2].propose(3, tick=0)
    rounds(swarm, 3)
    assert {party.slot_of for party in swarm} == {(0, 1, 3, 2)}
    assert swarm[0].counts.undone == 1


def test_a_versioned_amnesiac_joins() -> None:
    swarm = swarm_of(3)
    swarm[0].propose(1, tick=0)
    rounds(swarm, 6)
    swarm[2] = VersionedParty(2, range(3), RULES, nonce=1, amnesiac=True)
    with pytest.raises(IllegalSwap):
        swarm[2].propose(0, tick=0)
    rounds(swarm, 2)
    assert swarm[2].stance is Stance.IDLE
    assert swarm[2].slot_of == (1, 0, 2)
