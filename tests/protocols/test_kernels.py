"""The compiler's memory, once everything is compiled."""

import sys
from pathlib import Path

import pytest

from protocols.kernels import kernel, release_compiler


def resident_code_kb() -> int:
    """Of the compiler's code, what is in memory for this process."""
    resident, inside = 0, False
    for line in Path("/proc/self/smaps").read_text().splitlines():
        if "-" in line.split()[0]:
            inside = "libllvmlite" in line and " r-xp " in line
        elif inside and line.startswith("Rss:"):
            resident += int(line.split()[1])
    return resident


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_compilers_memory_is_given_back_and_it_still_compiles():
    kernel(lambda x: x + 1)(1)
    before = resident_code_kb()
    release_compiler()
    assert resident_code_kb() < before / 4
    assert kernel(lambda x: x * 2)(3) == 6
