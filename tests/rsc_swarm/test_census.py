"""What a process knows of itself."""

import subprocess
import sys
import time


def test_a_process_knows_to_some_hundredths_of_a_second_when_it_was_started() -> None:
    before = time.time()
    says = [sys.executable, "-c", "from rsc_swarm.machine.census import born_at; print(born_at())"]
    born = float(subprocess.run(says, capture_output=True, text=True, check=True, timeout=60).stdout)
    assert before - 0.05 < born < time.time()
