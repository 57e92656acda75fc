"""How fast episodes are simulated for training, and how fast VMAS, a widely used batch simulator, steps as many agents.

Both use all processors: ours as one process on each, VMAS as it does by itself (torch's threads).
"""

import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from multiprocessing import get_context
from typing import Any

from protocols.mission.document import Mission
from rsc_swarm.batch.batch import Batch
from rsc_swarm.machine.leaving import be_worker

_WORLDS = 48  # episodes that one process flies in step
_VMAS = """
import contextlib, io, sys, time
with contextlib.redirect_stderr(io.StringIO()):
    import torch
    from vmas import make_env
agents, worlds, steps, threads = (int(text) for text in sys.argv[1:])
torch.set_num_threads(threads)
environment = make_env(scenario="flocking", num_envs=worlds, device="cpu", continuous_actions=True, n_agents=agents, seed=0)
environment.reset()
actions = [torch.zeros(worlds, 2) for _ in range(agents)]
for _ in range(3):
    environment.step(actions)
began = time.perf_counter()
for _ in range(steps):
    environment.step(actions)
print(agents * worlds * steps / (time.perf_counter() - began))
"""
_VMAS_WORLDS = 256


def bench_batch(agents: int, quick: bool) -> dict[str, Any]:
    """Episodes and agent-steps per second of the analytic controller, each drone for itself, whole flights with their set-up;
    agent-steps per second of VMAS's flocking scenario, None if it is not installed.
    """
    batches = 1 if quick else 4
    processors = len(os.sched_getaffinity(0))
    _fly(agents, 0)  # loads the kernels before the fork
    began = time.perf_counter()
    with ProcessPoolExecutor(processors, get_context("fork"), be_worker) as pool:
        steps = list(pool.map(_fly, repeat(agents), range(1, 1 + batches * processors)))
    spent = time.perf_counter() - began
    return {
        "episodes_per_s": len(steps) * _WORLDS / spent,
        "batch_agent_steps_per_s": sum(steps) / spent,
        "vmas_agent_steps_per_s": _vmas(agents, 20 if quick else 60, processors),
    }


def _fly(agents: int, number: int) -> int:
    """Fly batch ``number`` (0: a single tick) to its end; agent-steps flown."""
    mission = Mission.model_validate({"agents": agents, "swap": {"rule": "off"}})
    seeds = range(1_000_000 + number * _WORLDS, 1_000_000 + (number + 1) * _WORLDS)
    batch = Batch([mission.model_copy(update={"map_seed": seed, "seed": seed}) for seed in seeds])
    batch.fly(mission.ticks if number else 1, analytic=True)
    return int(batch.stage.ticks.sum()) * agents


def _vmas(agents: int, steps: int, threads: int) -> float | None:
    arguments = [str(number) for number in (agents, _VMAS_WORLDS, steps, threads)]
    run = subprocess.run(
        [sys.executable, "-c", _VMAS, *arguments], capture_output=True, text=True, check=False
    )
    return None if run.returncode else float(run.stdout.split()[-1])
