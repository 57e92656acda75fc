"""What one drone with a valid login can do to the others: each attack is a function of a turn, its first line says what it tries.

All begin at `BEGIN`, so that each flight is an ordinary one first.
"""

import os
import struct
import threading
import time
from typing import Any

import msgpack
import zenoh

from protocols.slots.history import Swap, pack_swap
from protocols.slots.notes import SlotNote
from protocols.slots.seals import Sealed
from protocols.wire import keys, lies, messages
from protocols.wire.frames import FIXED, MAX_FRAME_BYTES, parts_of
from protocols.wire.messages import Hello, Ready, Reply
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from rsc_swarm.selfcheck.insider import Attack, Turn

BEGIN = 100  # tick
assert FIXED.fields is not None
_MOTION, _SENDER = (FIXED.fields[name][1] for name in ("motion", "sender"))


def nested_note(turn: Turn) -> None:
    """a slot note nested a thousand deep in every frame"""
    turn.answer_frame(note=b"\x91" * 1000 + b"\x01")


def long_messages(turn: Turn) -> None:
    """two megabytes of frame beside every answer"""
    turn.say(bytes(50_000))
    if turn.asked.tick % 50 == 0:
        turn.say(bytes(2_000_000))
    turn.answer()


def long_frames(turn: Turn) -> None:
    """frames longer than may be, inside good answers"""
    turn.answer(frame=bytes(MAX_FRAME_BYTES + 1 + turn.random.randrange(500)))


def hellos(turn: Turn) -> None:
    """a flood of HELLO, its own and those of a thousand processes"""
    for _ in range(100):
        turn.say(
            messages.pack(
                Hello(
                    messages.VERSION, turn.random.choice([turn.reply.process, turn.random.randrange(2**32)])
                )
            )
        )
    turn.answer()


def old_answers(turn: Turn) -> None:
    """a flood of its answers of earlier ticks"""
    kept = turn.memory.setdefault("kept", [])
    kept.append(messages.pack(turn.reply))
    for _ in range(100):
        turn.say(turn.random.choice(kept[-50:]))
    turn.answer()


def readies(turn: Turn) -> None:
    """a flood of READY"""
    for _ in range(100):
        turn.say(messages.pack(Ready(turn.reply.process)))
    turn.answer()


def garbage(turn: Turn) -> None:
    """a flood of random bytes, some of which begin like messages"""
    for _ in range(30):
        data = turn.random.randbytes(turn.random.randrange(1, 300))
        turn.say(turn.random.choice([b"", b"\x99\x02", b"\x01", b"\x00", b"\xdc\xff\xff"]) + data)
    turn.answer()


def swelling(turn: Turn) -> None:
    """messages that claim gigabytes, lists of thousands, maps, time stamps, and nest without end"""
    for bomb in (
        b"\x99\x02\xc6\xff\xff\xff\xff",
        b"\xdd\xff\xff\xff\xff",
        b"\xdc\x0f\xff" * 1300,
        b"\x91" * 4000,
        msgpack.packb([2, msgpack.Timestamp(2**40, 5)]),
        msgpack.packb([2, {1: {2: 3}}]),
        msgpack.packb([2, 2**64 - 1, -(2**63)]),
    ):
        turn.say(bomb)
    turn.answer()


def no_permutation(turn: Turn) -> None:
    """an account whose view gives one slot to all"""
    turn.answer(status=_status(turn, view=bytes(turn.agents)))


def absurd_counts(turn: Turn) -> None:
    """an account of a million swaps"""
    swaps = tuple(10**6 for _ in SWAP_COUNTS)
    turn.answer(status=_status(turn, swaps=swaps))


def borrowed_digest(turn: Turn) -> None:
    """an account that knows what all know, and believes something else"""
    status = turn.reply.status
    if status is None:
        turn.answer()
        return
    view = bytearray(status.view)
    a, b = (other for other in range(3) if other != turn.me) if turn.me < 3 else (0, 1)
    view[a], view[b] = view[b], view[a]
    turn.answer(status=status._replace(view=bytes(view)))


def anothers_slot(turn: Turn) -> None:
    """it claims the slot of another drone in every answer"""
    turn.answer(slot=(turn.reply.slot + 1) % turn.agents)


def forged_swaps(turn: Turn) -> None:
    """swaps between two others that neither of them has made"""
    turn.lie(lies.forged_swaps)


def absurd_counter(turn: Turn) -> None:
    """a swap of its own with the highest counter there is"""
    other = (turn.me + 1) % turn.agents
    op = Swap(2**56 - 1, turn.me, 1, turn.me, other, other, taken=True)
    swap = Sealed(op, turn.seals.seal(pack_swap(op)))
    turn.answer_frame(note=lies.packed(SlotNote(turn.random.randrange(2**64), False, ops=(swap,))))


def forged_checkpoint(turn: Turn) -> None:
    """a history of ten thousand swaps, after which all drones change places"""
    turn.lie(lies.forged_checkpoint)


def forged_permutations(turn: Turn) -> None:
    """another forged history every 0.3 s"""
    if turn.asked.tick % 30 == 0:
        forged_checkpoint(turn)
    else:
        turn.answer()


def anothers_name(turn: Turn) -> None:
    """frames in the names of others"""
    turn.answer_frame(fixed=_patched(turn, _SENDER, struct.pack("<H", turn.random.randrange(turn.agents))))


def impossible_motion(turn: Turn) -> None:
    """it says that it is where nobody can be so soon, at speeds that nothing has"""
    turn.lie(lies.impossible_motion)


def not_a_number(turn: Turn) -> None:
    """frames and commands that are not a number, or infinite"""
    nan = float("nan")
    if turn.asked.tick % 2:
        turn.say(messages.pack(turn.reply._replace(ax=nan, ay=float("inf"))))
    turn.answer_frame(fixed=_patched(turn, _MOTION, struct.pack("<4f", nan, 0.0, float("inf"), nan)))


def all_alive(turn: Turn) -> None:
    """it says that it has just heard everybody, the dead too"""
    turn.lie(lies.all_alive)


def repeats_others(turn: Turn) -> None:
    """it sends what it has heard from others as its own"""
    heard = [frame for _, frame in turn.asked.frames()]
    turn.answer(frame=turn.random.choice(heard) if heard else turn.reply.frame)


def late(turn: Turn) -> None:
    """every answer comes a second late"""
    time.sleep(1.0)
    turn.answer()


def silent(turn: Turn) -> None:
    """it never answers again"""


def blind(turn: Turn) -> None:
    """it answers ticks that it has not read"""
    for tick in range(turn.asked.tick, turn.asked.tick + 100):
        turn.say(messages.pack(Reply(turn.reply.process, tick, 0, 0.0, 0.0, turn.reply.slot, None, None)))
        time.sleep(0.005)


def deaf(turn: Turn) -> None:
    """a second link with its login reads nothing, until the pipe to it is full"""
    if "deaf" not in turn.memory:
        turn.memory["deaf"] = other = turn.open()
        ears = keys.rx(turn.swarm, turn.me)
        other._session.declare_subscriber(ears, zenoh.handlers.Callback(_never_return, indirect=False))
    turn.answer()


def fragments(turn: Turn) -> None:
    """messages of a hundred megabytes, in fragments"""
    if "mouth" not in turn.memory:
        mine, block = keys.tx(turn.swarm, turn.me), zenoh.CongestionControl.BLOCK
        turn.memory["mouth"] = turn.open_strange().declare_publisher(mine, congestion_control=block)
    if turn.asked.tick % 100 == 0:
        turn.memory["mouth"].put(bytes(100_000_000))
    turn.answer()


def declarations(turn: Turn) -> None:
    """it declares names without end, and does not read what the world says to that"""
    if "declared" not in turn.memory:
        turn.memory["declared"] = other = turn.open_strange()
        other.declare_subscriber(
            keys.rx(turn.swarm, turn.me), zenoh.handlers.Callback(_never_return, indirect=False)
        )
        threading.Thread(target=_declare, args=(other, turn.swarm), daemon=True).start()
    turn.answer()


def exits(turn: Turn) -> None:
    """its process ends at a random moment"""
    if turn.random.random() < 0.01:
        os._exit(turn.random.randrange(256))
    turn.answer()


def other_version(turn: Turn) -> None:
    """it speaks another version"""
    for _ in range(5):
        turn.say(messages.pack(Hello(messages.VERSION + 1, turn.reply.process)))
    turn.answer()


def second_process(turn: Turn) -> None:
    """a second process with its login knocks and answers too"""
    if "other" not in turn.memory:
        turn.memory["other"] = turn.open()
    other, process = turn.memory["other"], (turn.reply.process + 1) % 2**32
    if turn.asked.tick % 10 == 0:
        other.send(messages.pack(Hello(messages.VERSION, process)))
        other.send(messages.pack(Ready(process)))
    other.send(messages.pack(turn.reply._replace(process=process, ax=9.0)))
    turn.answer()


def _declare(session: zenoh.Session, swarm: str) -> None:
    kept: list[zenoh.Publisher] = []
    while True:
        kept.append(session.declare_publisher(f"{swarm}/{len(kept)}"))


def _never_return(_sample: zenoh.Sample) -> None:
    time.sleep(1e6)


def _status(turn: Turn, **instead: Any) -> AgentStatus:
    honest = turn.reply.status or AgentStatus(
        turn.reply.slot, 0, (0,) * 7, (0,) * len(SWAP_COUNTS), 1, bytes(range(turn.agents))
    )
    return honest._replace(**instead)


def _patched(turn: Turn, place: int, data: bytes) -> bytes:
    """The frame's record with other bytes at ``place``."""
    fixed = parts_of(turn.reply.frame).fixed if turn.reply.frame is not None else bytes(FIXED.itemsize)
    return fixed[:place] + data + fixed[place + len(data) :]


_ALL: tuple[Attack, ...] = (
    nested_note, long_messages, long_frames, hellos, old_answers, readies, garbage, swelling, no_permutation, absurd_counts,
    borrowed_digest, anothers_slot, forged_swaps, absurd_counter, forged_checkpoint, forged_permutations, anothers_name,
    impossible_motion, not_a_number, all_alive, repeats_others, late, silent, blind, deaf, fragments, declarations, exits,
    other_version, second_process,
)  # fmt: skip
ATTACKS: dict[str, Attack] = {attack.__name__.replace("_", "-"): attack for attack in _ALL}


def after_a_while(attack: Attack) -> Attack:
    """This attack from `BEGIN` on, honesty before."""

    def turn_then(turn: Turn) -> None:
        if turn.asked.tick < BEGIN:
            turn.answer()
        else:
            attack(turn)

    return turn_then
