"""Parties of a swarm that tell each other what they know, in one process."""

from protocols.slots.agreement import SlotNote, SlotParty, SwapRules

RULES = SwapRules()


def parties(n: int, rules: SwapRules = RULES) -> list[SlotParty]:
    return [SlotParty(agent, range(n), rules) for agent in range(n)]


def tell(speaker: SlotParty, *listeners: SlotParty, tick: int = 0) -> SlotNote:
    """One broadcast, heard by these."""
    note = speaker.note(tick)
    for listener in listeners:
        listener.hear(note, speaker.me, tick)
    return note


def rounds(swarm: list[SlotParty], count: int, tick: int = 0) -> None:
    for _ in range(count):
        for speaker in swarm:
            tell(speaker, *(party for party in swarm if party is not speaker), tick=tick)
