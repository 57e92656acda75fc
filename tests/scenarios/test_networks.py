"""Bad networks, over real sockets: what docs/networks.md says of cuts, resets and restarts, here in short."""

import subprocess
import sys

import pytest

from tests.scenarios.flights import ROOT
from tests.scenarios.wires import why_not

# More: python -m tests.scenarios.networks stories
STORIES = ["lockstep", "bad-link", "drone-realtime", "new-world"]


def test_cuts_resets_and_restarts_lose_nobody() -> None:
    if reason := why_not():
        pytest.skip(reason)
    run = subprocess.run(
        [
            sys.executable,
            "-m",
            "tests.scenarios.networks",
            "stories",
            *STORIES,
            "--seconds",
            "1.5",
            "--stopped-s",
            "1.5",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=240,
    )
    told = run.stdout.splitlines()
    assert "Traceback" not in run.stderr, run.stderr
    assert run.returncode == 0, told
    assert len(told) == 4 + 3
    assert all("nobody lost" in line for line in told[:6])
    assert "exit codes [3, 3, 3, 3]" in told[6]
