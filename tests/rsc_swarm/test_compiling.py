"""Compiling ahead: how far it has come is shown from the first moment, and afterwards nothing is left to compile."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Compiles one small rule for two kinds of arguments, and prints what the bar shows meanwhile.
ONE_RULE = """
import numpy as np
from protocols.kernels import by_reference
from rsc_swarm.cli import compiling
from world.glance import Watch, is_deserted

class Shown:
    due = lambda self: True
    begin = lambda self, text, total: print("total", total)
    draw = lambda self, done, text: print(done, text)
    close = lambda self: print("gone")

compiling.Meter = Shown
nobody, nothing = np.zeros((1, 1), np.bool_), np.zeros((1, 1), np.int64)
watch = Watch(nobody[0], nobody, nobody, nothing, nobody, nothing)
compiling._compile([lambda: (is_deserted(watch), is_deserted(by_reference(watch)))])
"""
# Flies in several ways, and prints which rules had to be compiled for it.
FLY = """
from protocols.kernels import compiling_watched

with compiling_watched(lambda rule: print(rule.__qualname__)):
    import rsc_swarm as rs
    from agent.process import rehearse
    from rsc_swarm.batch.batch import Batch

    fault = {"at_s": 0.01, "kind": "freeze", "agents": [1]}
    for policy in ("rsc-h20", "analytic", "saber"):
        rs.simulate([rs.mission(agents=3, policy=policy, fly_s=0.05, radio={"loss": 0.2}, faults=[fault])])
    rs.simulate([rs.mission(agents=3, policy="cruise", fly_s=0.05, seed=seed) for seed in range(2)])
    rehearse(rs.mission(agents=2))
    Batch([rs.mission(agents=2, fly_s=0.05)]).fly(5)
"""


def run(*words: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, *words], cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_bar_counts_the_rules_from_the_first_moment(tmp_path: Path) -> None:
    total, *shown, gone = run("-c", ONE_RULE, HOME=str(tmp_path), XDG_CACHE_HOME="").splitlines()
    rules = int(total.removeprefix("total "))
    assert rules > 10
    assert shown == [f"{ready} compiling the rules: {ready} of {rules}" for ready in (0, 1, 1)]
    assert gone == "gone"


def test_after_a_warm_up_nothing_is_left_to_compile_and_the_compiler_is_not_loaded() -> None:
    assert run("-m", "rsc_swarm", "warm-up") == "all rules are compiled\n"
    loaded = "import sys; print('numba' in sys.modules, 'protocols.compiler' in sys.modules)"
    assert run("-c", FLY + loaded) == "False False\n"
