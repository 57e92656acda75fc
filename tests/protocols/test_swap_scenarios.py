"""Golden scenarios: `scenarios/NAME.txt` is a script, `scenarios/NAME.out.txt` the transcript it must give.

A script is one command per line; `#` begins a remark. Agent k starts in slot k; one tick is 10 ms.

    agents N            begin with N agents, all in reach of each other
    propose A B         A asks B to exchange slots
    vacate A B          A takes the slot of B, who is dead
    say A               A broadcasts: one frame to each agent in reach is now in the air
    deliver A->B        the oldest frame in the air from A to B arrives
    double A->B         the same, but the frame arrives once more later
    drop A->B, drop     that frame is lost; all frames in the air are lost
    rounds K            K ticks; in each, all broadcast once and all in reach hear it
    wait K              K ticks in which nobody speaks
    part 0 1 | 2 3      only agents of one group hear each other
    heal                all are in reach of each other again
    kill A, return A    A falls silent; A is back and remembers everything
    restart A amnesia   A is back and remembers nothing
    views               who sees whom in which slot

After each command come the events it led to. With RSC_SWARM_REWRITE=1 the transcripts are written anew.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from swap_net import Swarm

from protocols.slots.agreement import SlotNote, SlotParty, Stance, SwapRules

FOLDER = Path(__file__).parent / "scenarios"
SCRIPTS = sorted(path for path in FOLDER.glob("*.txt") if not path.name.endswith(".out.txt"))


class Transcript:
    """Runs a script, command by command, and writes down what happens."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.swarm = Swarm(1)

    def run(self, script: str) -> str:
        for line in script.splitlines():
            command = line.split("#")[0].split()
            self.lines.append(line and f"> {line}" if command else line)
            if command:
                self._do(command[0], command[1:])
        return "\n".join(self.lines) + "\n"

    def _do(self, verb: str, words: list[str]) -> None:
        swarm = self.swarm
        numbers = [int(word) for word in words if word.isdigit()]
        simple: dict[str, Callable[[], object]] = {
            "vacate": lambda: swarm.vacate(*numbers),
            "propose": lambda: swarm.propose(*numbers),
            "heal": swarm.heal,
            "kill": lambda: swarm.kill(*numbers),
            "return": lambda: swarm.revive(*numbers),
            "restart": lambda: swarm.restart(*numbers),
        }
        if verb == "agents":
            self.swarm = Swarm(*numbers, SwapRules())
        elif verb == "part":
            swarm.part([map(int, group.split()) for group in " ".join(words).split("|")])
        elif verb == "views":
            self._views()
        elif verb == "rounds" or verb == "wait":
            for _ in range(*numbers):
                self._watch(swarm.round if verb == "rounds" else lambda: swarm.wait(1))
        elif verb == "say":
            self._write(f"{numbers[0]} {in_words(swarm.say(*numbers))}")
        elif verb == "drop" and not words:
            swarm.air.clear()
        elif verb in ("deliver", "double", "drop"):
            src, dst = map(int, words[0].split("->"))
            index = next(i for i, packet in enumerate(swarm.air) if packet[:2] == (src, dst))
            if verb == "drop":
                swarm.drop(index)
            else:
                self._watch(lambda: swarm.deliver(index, keep=verb == "double"))
        elif verb in simple:
            self._watch(simple[verb])
        else:
            raise ValueError(f"no such command: {verb}")

    def _watch(self, act: Callable[[], object]) -> None:
        before = [snapshot(party) for party in self.swarm.endpoints]
        refusal = act()
        if refusal:
            self._write(f"not allowed: {refusal}")
        for agent, party in enumerate(self.swarm.endpoints):
            for event in events(before[agent], snapshot(party)):
                self._write(f"{agent} {event}")

    def _views(self) -> None:
        seen: dict[str, list[str]] = {}
        for party in self.swarm.living:
            slots = " ".join(map(str, sorted(range(len(party.slot_of)), key=party.slot_of.__getitem__)))
            book = party.book
            view = f"occupants of slots 0, 1, ...: {slots}   swaps {book.count}, not settled {book.count - book.settled}"
            seen.setdefault(view, []).append(str(party.me))
        for view, who in seen.items():
            self._write(f"{' '.join(who)}: {view}")

    def _write(self, text: str) -> None:
        self.lines.append(f"      tick {self.swarm.tick:<5}{text}")


def snapshot(party: SlotParty) -> dict[str, object]:
    """What events are told from."""
    deal, book = party.deal, party.book
    bond = ""
    if deal is not None and party.stance is Stance.PROPOSING:
        bond = f"asks {deal.partner} to give slot {deal.partner_slot} for slot {deal.slot}"
    elif deal is not None:
        bond = f"promises {deal.proposer} slot {deal.partner_slot} for slot {deal.slot}"
    return {
        "bond": bond,
        "slot": party.slot,
        "amnesiac": party.stance is Stance.AMNESIAC,
        "settled": book.settled,
        "skips": set(book.skipped),
        **vars(party.counts),
    }


def events(before: dict[str, object], after: dict[str, object]) -> list[str]:
    told = {
        "refused": "hears no",
        "timed_out": "has waited too long and is free again",
        "withdrawn": "drops its own proposal",
        "committed": "hears yes, and commits",
        "vacated": "closes ranks",
        "undone": "goes back on a swap: an earlier one by the order has come to light",
        "unsealed": "does not believe a swap that lacks a seal",
    }
    lines = [text for name, text in told.items() if after[name] > before[name]]  # type: ignore[operator]
    if after["bond"] != before["bond"] and after["bond"]:
        lines.append(str(after["bond"]))
    if after["slot"] != before["slot"]:
        lines.append(f"moves from slot {before['slot']} to slot {after['slot']}")
    if after["amnesiac"] != before["amnesiac"]:
        lines.append("remembers nothing" if after["amnesiac"] else "knows again who is where, and joins")
    if after["skips"] - before["skips"]:  # type: ignore[operator]
        lines.append("skips a swap whose slots had changed hands")
    if after["settled"] > before["settled"] and not before["amnesiac"]:  # type: ignore[operator]
        lines.append(f"settles: everybody has had {after['settled']} swaps")
    return lines


def in_words(note: SlotNote) -> str:
    """What a note says."""
    said = []
    if note.amnesiac:
        said.append("I remember nothing")
    if note.proposal:
        said.append(f"I ask {note.proposal.partner} for slot {note.proposal.partner_slot}")
    if note.acceptance:
        said.append(f"I accept {note.acceptance.proposer}'s proposal")
    said += [f"no to {refusal.proposer}'s proposal" for refusal in note.refusals]
    for op, _ in note.ops:
        slots = f"{op.agent_a} and {op.agent_b}, slots {op.slot_a} and {op.slot_b}"
        said.append(f"swap {op.counter} by {op.agent_a}: {slots}")
    if note.had:
        who = [str(agent) for agent in range(note.had.bit_length()) if note.had >> agent & 1]
        said.append(f"{' '.join(who)} had just these swaps")
    return "says: " + ("; ".join(said) or "nothing new")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_script_gives_its_transcript(script: Path) -> None:
    golden = script.with_suffix(".out.txt")
    transcript = Transcript().run(script.read_text())
    if os.environ.get("RSC_SWARM_REWRITE") == "1":
        golden.write_text(transcript)
    assert transcript == golden.read_text()


def test_there_are_scripts() -> None:
    assert len(SCRIPTS) >= 8
