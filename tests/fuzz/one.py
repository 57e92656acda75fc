"""One target under atheris: ``python -m tests.fuzz.one TARGET FINDINGS WORD...`` (of libFuzzer), as ``tests.fuzz`` starts it.

What is raised undeclared is kept under FINDINGS, once for each place, and the fuzzing goes on. A hang, or more memory than is
allowed, ends it; libFuzzer keeps the input.
"""

import hashlib
import random
import sys
import time
import traceback
import warnings
from pathlib import Path

import atheris

OURS = ["protocols", "agent", "world", "rsc_swarm"]
# What only moves bytes, each by itself: nothing there depends on them, and to watch it would take a third of a frame's time.
MOVES_BYTES = ["protocols.wire.rows"]
with atheris.instrument_imports(include=OURS, exclude=MOVES_BYTES):
    from tests.fuzz.targets import TARGETS, is_declared

LONGEST_S = 3.0  # of the processor's time, for one input
OWN_CHANGES = 0.7  # of all; the rest are libFuzzer's, which knows what was compared with what
VALID = 0.3  # of our own, of a valid input: nearly all of libFuzzer's corpus is refused, and is so when it is changed again


def place_of(error: BaseException) -> str:
    """Where it was raised, as a name for a file."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [
        frame for frame in frames if "site-packages" not in frame.filename and "/fuzz/" not in frame.filename
    ]
    last = (ours or frames)[-1]
    return f"{type(error).__name__}-in-{Path(last.filename).stem}.{last.name}".replace("<", "").replace(
        ">", ""
    )


def main() -> None:
    name, findings, *words = sys.argv[1:]
    target, seen = TARGETS[name], set[str]()
    valid = tuple(target.seeds())
    warnings.simplefilter("ignore")  # zipfile's, about a name written twice

    def keep(place: str, data: bytes, told: str) -> None:
        if place not in seen:
            seen.add(place)
            file = Path(findings) / f"{place}-{hashlib.sha1(data).hexdigest()[:6]}"
            file.write_bytes(data)
            Path(f"{file}.txt").write_text(told, errors="backslashreplace")

    def read(data: bytes) -> None:
        began = time.process_time()
        try:
            target.read(data)
        except Exception as error:
            if not is_declared(target, error):
                keep(place_of(error), data, "".join(traceback.format_exception(error)))
        if (took := time.process_time() - began) > LONGEST_S:
            keep("takes-long", data, f"{took:.1f} s of the processor's time")

    def changed(data: bytes, longest: int, seed: int) -> bytes:
        draw = random.Random(seed)
        if draw.random() > OWN_CHANGES:
            return bytes(atheris.Mutate(data, longest))
        data = draw.choice(valid) if draw.random() < VALID else data
        for _ in range(draw.choice((1, 1, 1, 2, 3))):
            data = target.change(data, draw)[:longest]
        return data

    atheris.Setup([sys.argv[0], *words], read, custom_mutator=changed)
    atheris.Fuzz()


main()
