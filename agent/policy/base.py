"""The policy interface, and how a policy is found by name.

A policy is a class whose constructor takes the mission and which has one method, ``act``. It is known by a short name
(`_BUILT_IN`), by an entry point in the group ``rsc_swarm.policies``, or by ``package.module:Class``. Learned ones are known by
their model file: by its name if it comes with the project, else by its path.
"""

import importlib
from importlib.metadata import entry_points
from pathlib import Path
from typing import NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory
from agent.policy.model_file import SHIPPED, shipped_models
from agent.tick_arrays import TickArrays
from protocols.mission.document import Mission

ENTRY_POINTS = "rsc_swarm.policies"
_BUILT_IN = {
    "analytic": "agent.policy.analytic:Analytic",
    "cruise": "agent.policy.cruise:Cruise",
    "saber": "agent.policy.saber:Saber",
}


class PolicyError(ValueError):
    """No such policy, or it cannot be loaded; the message says which are known."""


class Seen(NamedTuple):
    """What a policy may look at: one row per hosted drone (a process on a drone hosts one, a simulation many).

    tick: 10 ms each. me: (A,) agent numbers. awake: (A,) rows to act for; the others' answers are ignored.
    motion: (A, 8) own p, own v, virtual target p, virtual target v; common local frame, m and m/s.
    chain_error, slot_error: (A, 2) target minus position [m] (agent.observation.aim).
    observation: (A, 18) the paper's X_i. memory: neighbours, obstacles and what neighbours' frames said. arrays: all of these as
    one object for compiled policies (agent.tick_arrays).
    """

    tick: int
    me: NDArray[np.int64]
    awake: NDArray[np.bool_]
    motion: NDArray[np.float64]
    chain_error: NDArray[np.float64]
    slot_error: NDArray[np.float64]
    observation: NDArray[np.float64]
    memory: Memory
    arrays: TickArrays

    @property
    def velocity(self) -> NDArray[np.float64]:
        """(A, 2) own velocity [m/s]."""
        return self.motion[:, 2:4]

    @property
    def target_velocity(self) -> NDArray[np.float64]:
        """(A, 2) velocity of the virtual target [m/s]."""
        return self.motion[:, 6:8]


class Policy(Protocol):
    """Decides accelerations. The safety filter and the limits come after it.

    A policy may have more, and is then told more (agent.core): ``open()``, before the first tick and only in a process that
    forks no other, is the place to open what must not be forked; ``forget(row)`` says that a row's drone was restarted.
    ``files``, paths of what besides its code decides what it does, tell evaluations apart.
    """

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration of every row, (A, 2) m/s^2."""
        ...


def policy_names() -> list[str]:
    """The policies that have a short name here."""
    return sorted(
        {*_BUILT_IN, *shipped_models(), *(point.name for point in entry_points(group=ENTRY_POINTS))}
    )


def find_policy(name: str, mission: Mission) -> Policy:
    """The policy called ``name``, made for this mission.

    Raises:
        PolicyError: unknown name, or the class cannot be imported or made.
    """
    if name in shipped_models() or name.endswith(".onnx"):
        from agent.policy.learned import Learned  # loads ONNX Runtime

        return Learned(mission, SHIPPED / f"{name}.onnx" if name in shipped_models() else Path(name))
    place = _BUILT_IN.get(name, name)
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == name:
            place = point.value
    module_name, _, class_name = place.partition(":")
    if not class_name:
        known = ", ".join(policy_names())
        raise PolicyError(
            f"policy: unknown policy {name!r}; known: {known}; or give package.module:Class or a model file"
        )
    try:
        made = getattr(importlib.import_module(module_name), class_name)(mission)
    except (ImportError, AttributeError) as error:
        raise PolicyError(f"policy: {place!r} cannot be loaded ({error})") from None
    except Exception as error:
        raise PolicyError(f"policy: {place!r} could not be made for this mission ({error})") from error
    if not callable(getattr(made, "act", None)):
        raise PolicyError(f"policy: {place!r} has no method act(seen)")
    return cast(Policy, made)
