"""Rules as the Python they are written in (RSC_SWARM_PYTHON_KERNELS=1): slow, and in everything else the same."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RULES = [
    f"tests/{place}.py"
    for place in (
        "agent/test_control", "agent/test_follow", "agent/test_observation", "agent/test_perceive", "agent/test_target",
        "protocols/test_dynamics", "protocols/test_relative", "protocols/test_trigger", "world/test_chance",
        "world/test_physics", "world/test_referee",
    )
]  # fmt: skip
# Half a second of every rule there is: lossy radio, swaps, obstacles in reach from the start, a plan of a model.
FLIGHT = """
from protocols.mission.document import parse_mission
from rsc_swarm.flight.simulate import simulate
for policy in ("rsc-h20", "saber", "analytic"):
    print(simulate([parse_mission({
        "agents": 4, "fly_s": 0.5, "policy": policy, "start": {"scrambled": True}, "swap": {"connected": True},
        "obstacles": {"discs": [[3, 1, 1], [4, -3, 1.5]]},
        "radio": {"loss": 0.2, "jitter_ms": 20, "duplicate": 0.1, "reorder": 0.1, "burst": {"loss": 0.1}},
        "faults": [{"at_s": 0.2, "kind": "restart", "agents": [1]}],
    })])[0].digest)
"""


def run(*command: str, uncompiled: bool) -> str:
    """What Python prints; without a warning."""
    done = subprocess.run(
        [sys.executable, "-W", "error", *command], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "RSC_SWARM_PYTHON_KERNELS": str(int(uncompiled))},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_flight_without_compiler_is_the_same_bit_for_bit() -> None:
    assert run("-c", FLIGHT, uncompiled=True) == run("-c", FLIGHT, uncompiled=False)


def test_the_rules_pass_their_tests_without_compiler() -> None:
    run("-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *RULES, uncompiled=True)


def test_nothing_is_compiled_then() -> None:
    command = "from agent.tick import before_policy; from protocols.kernels import is_kept, kernel; "
    says = run("-c", command + "print(type(before_policy).__name__, is_kept(before_policy))", uncompiled=True)
    assert says.split() == ["function", "True"]
