"""What a process knows of itself."""

import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from rsc_swarm.machine.census import anonymous_bytes


def test_a_process_knows_to_some_hundredths_of_a_second_when_it_was_started() -> None:
    before = time.time()
    says = [sys.executable, "-c", "from rsc_swarm.machine.census import born_at; print(born_at())"]
    born = float(subprocess.run(says, capture_output=True, text=True, check=True, timeout=60).stdout)
    assert before - 0.05 < born < time.time()


def test_what_a_process_took_for_itself_grows_by_what_it_takes_and_not_by_a_file_it_maps(
    tmp_path: Path,
) -> None:
    file = tmp_path / "library"
    file.write_bytes(bytes(50_000_000))
    before = anonymous_bytes(os.getpid())
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        assert sum(mapped[::4096]) == 0  # all of it was looked at
        assert anonymous_bytes(os.getpid()) - before < 10_000_000
    taken = bytearray(b"x") * 50_000_000
    assert anonymous_bytes(os.getpid()) - before > 40_000_000, len(taken)


def test_who_weighs_a_process_keeps_nothing_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    interned: list[str] = []
    monkeypatch.setattr(sys, "intern", lambda name: interned.append(name) or name)
    anonymous_bytes(os.getpid())
    assert interned == []
    sys._clear_type_cache()
    before = sys.getallocatedblocks()
    for _ in range(200):
        anonymous_bytes(os.getpid())
    assert sys.getallocatedblocks() - before < 100  # other threads of a test run make some


def test_nobody_has_the_number_of_a_process_that_is_gone() -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    with pytest.raises(psutil.NoSuchProcess):
        anonymous_bytes(gone.pid)
