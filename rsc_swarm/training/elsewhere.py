"""The flights of an epoch on the workers of an executor (rsc_swarm.study.machines): each part of them is a task."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from socket import gethostname
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from protocols.errors import BrokenError
from rsc_swarm.study.workers import told_in_a_line
from rsc_swarm.training.flying import Flown, Part, fly
from rsc_swarm.training.network import PolicyNetwork, make_network
from rsc_swarm.training.replay import Replay, Samples

Arrays = dict[str, NDArray[np.generic]]


class OtherMachineError(BrokenError, RuntimeError):
    """A worker on which the policy would not plan the same; one line says why."""


class Planner(NamedTuple):
    """How the policy plans here, and so is to plan elsewhere. weights: by name; torch: its version; device: cpu or cuda."""

    weights: Arrays
    torch: str
    threads: int
    device: str


def fly_elsewhere(
    executor: Executor,
    parts: Sequence[Part],
    policy: PolicyNetwork,
    replay: Replay,
    each_part: Callable[[], None],
) -> Flown:
    """As rsc_swarm.training.flying.fly of one part after the other.

    Raises:
        OtherMachineError, rsc_swarm.study.workers.WorkerError: a worker could not fly.
    """
    weights = {name: value.cpu().numpy() for name, value in policy.state_dict().items()}
    planner = Planner(weights, torch.__version__, torch.get_num_threads(), policy.device.type)
    flown, flying = Flown(), []
    with told_in_a_line():
        try:
            flying = [executor.submit(fly_there, part, planner) for part in parts]
            for future in flying:
                theirs, graphs = future.result()
                replay.add(Samples(**_tensors(graphs)))
                flown.add(theirs)
                each_part()
        finally:  # nobody wants the rest any more
            for future in flying:
                future.cancel()
    return flown


def fly_there(part: Part, planner: Planner) -> tuple[Flown, Arrays]:
    """A worker's task: what its flights add up to, and the graphs, as a replay keeps them.

    Raises:
        OtherMachineError: not here.
    """
    if torch.__version__ != planner.torch:
        raise OtherMachineError(
            f"worker {gethostname()} has torch {torch.__version__}, not {planner.torch} as this command: install the same"
        )
    if planner.device == "cuda" and not torch.cuda.is_available():
        raise OtherMachineError(
            f"worker {gethostname()} has no GPU, as this command does: start workers where one is, or give --device cpu"
        )
    torch.set_num_threads(planner.threads)
    policy = make_network(part.config).to(planner.device).eval().requires_grad_(False)
    policy.load_state_dict(_tensors(planner.weights))
    replay = Replay(part.config, torch.device("cpu"), part.graphs)
    flown = fly(part, policy, replay, lambda: None)
    return flown, {name: values.numpy() for name, values in replay.newest(part.graphs)._asdict().items()}


def _tensors(arrays: Arrays) -> dict[str, torch.Tensor]:
    """Copies: what came over a wire may not be written to."""
    return {name: torch.from_numpy(np.array(array)) for name, array in arrays.items()}
