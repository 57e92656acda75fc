"""The policy interface: a policy is a class whose constructor takes the mission and which has one method, ``act``."""

from collections.abc import Callable, Mapping
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from agent.memory import Memory
from agent.quick import Quick
from agent.tick_arrays import TickArrays
from protocols.errors import ExitCode, SwarmError


class PolicyError(SwarmError, ValueError):
    """A policy that cannot be had or went wrong; one line names it and says where."""


class PolicyStuck(PolicyError):
    """A policy that did not return and was stopped by whoever flies."""

    exit_code = ExitCode.INTERRUPTED


class Seen:
    """What a policy may look at: one row per hosted drone (a process on a drone hosts one, a simulation many).

    Arrays are the policy's own: read-only copies, made when they are first looked at. They may be kept; what has not been looked
    at when ``act`` returns is gone.

    tick: 10 ms each. me: (A,) agent numbers. awake: (A,) rows to act for; the others' answers are ignored.
    position, velocity, target_position, target_velocity: (A, 2) own and the virtual target's; common local frame, m and m/s.
    chain_error, slot_error: (A, 2) target minus position [m] (agent.observation.aim_row).
    observation: (A, 18) the paper's X_i. memory: neighbours, obstacles and what neighbours' frames said. arrays: all of these as
    one object for compiled policies (agent.tick_arrays): the drones' own arrays, not copies.
    """

    tick: int
    me: NDArray[np.int64]
    awake: NDArray[np.bool_]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    target_position: NDArray[np.float64]
    target_velocity: NDArray[np.float64]
    chain_error: NDArray[np.float64]
    slot_error: NDArray[np.float64]
    observation: NDArray[np.float64]
    memory: Memory
    arrays: TickArrays

    def __init__(self, tick: int, shown: Mapping[str, NDArray[Any] | Memory], arrays: TickArrays) -> None:
        """``shown``: the drones' own arrays by the names of the fields above, those before ``arrays``."""
        self.tick, self.arrays = tick, arrays
        self._shown, self._over = shown, False

    def __getattr__(self, name: str) -> Any:
        """A field that is looked at for the first time."""
        if name.startswith("_") or name not in self._shown:
            raise AttributeError(
                f"Seen has no {name!r}; it has tick, {', '.join(vars(self).get('_shown', ()))}, arrays"
            )
        if self._over:
            raise RuntimeError(
                f"seen.{name} of tick {self.tick} is gone; look at it while act runs, then it may be kept"
            )
        value = self._shown[name]
        copied = (
            Memory(*map(_copy, cast("tuple[Any, ...]", value))) if isinstance(value, Memory) else _copy(value)
        )
        vars(self)[name] = copied
        return copied

    def close(self) -> None:
        """``act`` has returned."""
        self._over = True


def _copy(array: NDArray[Any]) -> NDArray[Any]:
    copied = array.copy()
    copied.flags.writeable = False
    return copied


class Policy(Protocol):
    """Decides accelerations. The safety filter and the limits come after it.

    A policy may have more, and is then told more (agent.core): ``open()``, before the first tick and only in a process that
    forks no other, is the place to open what must not be forked; ``share()``, in a process that will fork, to open what all
    drones may share; ``forget(row)`` says that a row's drone was restarted.
    ``files``, paths of what besides its code decides what it does, tell evaluations apart. ``many_flights``, if true: one object
    may be handed the rows of several flights that differ in their seeds; otherwise each flight has an object of its own.
    """

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration of every row, (A, 2) m/s^2."""
        ...


class Compiled:
    """A policy whose ``act`` is compiled code, which works on the drones' own arrays: the way that costs least.

    rounds: of aggregation over the air that it asks for (agent.relay).
    made_at: (A,) tick at which each row planned last, from the first tick on the same array; None if no plan outlasts its tick.
    shown_after: (P,) ticks after that, which `plans` shows.
    """

    many_flights = True
    rounds = 0
    made_at: NDArray[np.int64] | None = None
    shown_after: NDArray[np.int64]

    def act_on_arrays(self, tick: int, arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
        """Write the accelerations (A, 2) m/s^2 of the awake rows into ``wanted``, the same array every time."""
        raise NotImplementedError

    def quickly(self, quick: Quick) -> Callable[[], int] | None:
        """What flies a drone's whole tick (agent.quick) and returns the Reply's size, or `RARE`; None if the policy has nothing
        like it. Not asked for before the first tick."""
        return None

    def plans(self, tick: int) -> NDArray[np.float32] | None:
        """Where each row plans to be, (A, P, 2) m, NaN for what lies behind it as this tick begins, and where it has planned
        nothing; None if it plans nothing ever. For those who look on; no drone asks for it."""
        return None

    def act(self, seen: Seen) -> NDArray[np.float64]:
        """Wanted acceleration of every row, (A, 2) m/s^2."""
        wanted = np.zeros((len(seen.awake), 2))
        self.act_on_arrays(seen.tick, seen.arrays, wanted)
        return wanted
