"""``python -m tests.fuzz [TARGET ...] [--runs N] [--seconds S] [--keep]``: fuzz the decoders by coverage, one line for each.

What is found lies in build/fuzz/TARGET: ``findings``, with a traceback beside each, and ``corpus``, all inputs that reached
something new, from which the next run goes on. ``--keep`` copies to tests/fuzz/corpus the few of them that reach branches that
nothing kept there does.
"""

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

from tests.fuzz.reach import CORPUS, ROOT, Reach, kept, reach
from tests.fuzz.targets import TARGETS

BUILD = ROOT / "build" / "fuzz"
LONGEST_INPUT, HANGS_S, MOST_MB = 8192, 300, 2048  # a machine that does other things beside does not hang
_LARGEST_KEPT = 4096


def fuzz(name: str, runs: int, seconds: int) -> str:
    """Fuzz one target in a process of its own; the line that tells of it."""
    folder = BUILD / name
    corpus, findings, seeds = folder / "corpus", folder / "findings", folder / "seeds"
    for place in (corpus, findings, seeds):
        place.mkdir(parents=True, exist_ok=True)
    before = set(findings.iterdir())
    for label, data in kept(name).items():
        (seeds / label).write_bytes(data)
    words = [
        f"-runs={runs}",
        f"-max_total_time={seconds}",
        f"-max_len={LONGEST_INPUT}",
        f"-timeout={HANGS_S}",
        f"-report_slow_units={HANGS_S}",  # by the clock on the wall; `tests.fuzz.one` goes by the processor's
        f"-rss_limit_mb={MOST_MB}",
        f"-artifact_prefix={findings}/",
        "-print_final_stats=1",
        "-verbosity=0",
        str(corpus),
        str(seeds),
    ]
    log = folder / "log.txt"
    with log.open("w") as out:
        subprocess.run(
            [sys.executable, "-m", "tests.fuzz.one", name, str(findings), *words],
            stdout=out, stderr=subprocess.STDOUT, env={**os.environ, "TMPDIR": _temporary(folder)}, check=False,
        )  # fmt: skip
    told = log.read_text(errors="replace")
    done, peak = (
        int(found[-1]) if (found := re.findall(rf"stat::{stat}:\s+(\d+)", told)) else 0
        for stat in ("number_of_executed_units", "peak_rss_mb")
    )
    reached = reached_by(name, corpus)
    new = sorted(file.name for file in set(findings.iterdir()) - before if file.suffix != ".txt")
    bad = f"; FOUND {', '.join(new)}" if new else "" if done else f"; broke, see {log}"
    share = (
        f"{reached.taken} of {reached.branches} branches ({reached.share:.1%})"
        if reached.branches
        else "branches of a library"
    )
    return f"{name:12} {done:>11,} inputs, {share}, {peak} MB{bad}"


def reached_by(name: str, corpus: Path) -> Reach:
    """What the kept corpus and that of this machine reach together."""
    said = subprocess.run(
        [sys.executable, "-m", "tests.fuzz.reach", name, str(corpus)],
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    ).stdout
    found = Reach(**json.loads(said.splitlines()[-1]))
    (BUILD / name / "missing.txt").write_text("".join(f"{line}\n" for line in found.missing))
    return found


def keep(name: str) -> None:
    """Copy what reaches more than all that is kept, the shortest first."""
    target, have = TARGETS[name], list(kept(name).values())
    reached = reach(target, have).taken
    files = sorted((BUILD / name / "corpus").iterdir(), key=lambda file: file.stat().st_size)
    texts = [text for file in files if len(text := file.read_bytes()) <= _LARGEST_KEPT]
    while (more := reach(target, [*have, *texts]).taken) > reached and texts:
        low, high = 0, len(texts)  # the shortest beginning of the list that reaches more: its last input does
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (
                (low, middle) if reach(target, [*have, *texts[:middle]]).taken > reached else (middle, high)
            )
        data = texts[high - 1]
        have.append(data)
        reached = reach(target, have).taken
        (CORPUS / name).mkdir(parents=True, exist_ok=True)
        (CORPUS / name / f"reaches-more-{hashlib.sha1(data).hexdigest()[:6]}").write_bytes(data)
        assert reached <= more


def _temporary(folder: Path) -> str:
    """Where files are read from: in memory if there is such a place."""
    memory = Path("/dev/shm")
    return str(memory if os.access(memory, os.W_OK) else folder)


def main() -> None:
    words = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Fuzz the decoders by coverage.")
    words.add_argument(
        "targets", nargs="*", default=[], help=f"of {', '.join(TARGETS)}; all if none is given"
    )
    words.add_argument("--runs", type=int, default=-1, help="inputs for each (as many as there is time for)")
    words.add_argument("--seconds", type=int, default=60, help="for each (60); 0: no limit")
    words.add_argument(
        "--keep", action="store_true", help="keep the inputs that reach more than those kept before"
    )
    asked = words.parse_args()
    if unknown := set(asked.targets) - set(TARGETS):
        words.error(f"no such target: {', '.join(sorted(unknown))}")
    bad = False
    for name in asked.targets or TARGETS:
        line = fuzz(name, asked.runs, asked.seconds)
        print(line, flush=True)
        bad |= "FOUND" in line or "broke" in line
        if asked.keep:
            keep(name)
    sys.exit(bad)


main()
