"""Learned policies: a model file plans a trajectory now and then, and the drone flies it meanwhile.

The files rsc-h1 ... rsc-h40 and stgnn come with the project; any other is given by its path.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.control.follow import following_of
from agent.policy import session
from agent.policy.base import Compiled, PolicyError
from agent.policy.learned_kernel import (
    DUE,
    Planner,
    Telling,
    ask_or_fly,
    empty_history,
    empty_plans,
    empty_question,
    fly_quickly,
    show_plans,
    take_plans,
)
from agent.policy.model_file import ModelFileError, note_of, read_model
from agent.quick import Quick
from agent.tick_arrays import TickArrays
from protocols.kernels import bound, by_reference, rebound
from protocols.mission.document import Mission
from protocols.relative import NEVER
from protocols.wire.planned import SHOWN
from protocols.wire.rows import as_bytes

_OUTPUTS = ["displacement", "acceleration"]
_ROWS = 32  # asked in one call; more would no longer fit the processor's caches


class Learned(Compiled):
    """Flies what the model plans. A row's plan depends on nothing but that row, however many are hosted together."""

    def __init__(self, mission: Mission, path: Path) -> None:
        """Read and check the model file; nothing is opened yet.

        Raises:
            PolicyError: the file holds no policy, or it does not fit the mission.
        """
        try:
            self.model = read_model(path)
        except ModelFileError as error:
            raise PolicyError(f"policy: {error}") from None
        self.files = (path, note_of(path))
        facts, trajectory = self.model.facts, mission.trajectory
        self._replan = trajectory.replan_ticks or facts.replan
        if self._replan > facts.horizon:
            raise PolicyError(
                f"trajectory.replan_ticks: {self._replan}, but {mission.policy} plans {facts.horizon} ticks; give at most that"
            )
        following = following_of(mission)
        if (
            facts.output != "knots"
        ):  # raw plans hold no accelerations to follow; an action is carried out as it is
            following = following._replace(required=facts.output == "raw")
        self._following = following
        self.shown_after = np.ceil(np.linspace(0, facts.horizon, SHOWN + 1)).astype(np.int64)[1:]
        self._inputs = [name for name in facts.shapes if name not in _OUTPUTS]
        self.rounds = facts.rounds
        self._session: Any = None
        self._show, self._now = rebound(show_plans), np.zeros(1, np.int64)
        self._make_room(np.zeros((0, 2)))

    def _make_room(self, wanted: NDArray[np.float64]) -> None:
        facts, rows = self.model.facts, len(wanted)
        neighbours = 0 if facts.rounds else facts.neighbours
        self._history = empty_history(rows, facts.past, neighbours)
        self._question = empty_question(rows, facts.past, neighbours, facts.rounds)
        self._plans = empty_plans(rows, facts.horizon)
        self.made_at = self._plans.made_at if facts.horizon > 1 else None
        self._shown = np.zeros((rows, SHOWN, 2), np.float32)
        self._wanted = wanted
        self._planner = by_reference(
            Planner(self._replan, self._following, self._history, self._question, self._plans, self._wanted)
        )

    def share(self) -> None:
        """As `open`: a session on one thread may be forked."""
        self.open()

    def open(self) -> None:
        """Make the model ready to run.

        Raises:
            PolicyError: the model cannot be run.
        """
        try:
            self._session = session.open_session(self.model.data)
        except RuntimeError as error:
            raise PolicyError(f"policy: {self.model.path}: cannot be run ({error})") from None

    def act_on_arrays(self, tick: int, arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
        """As the base class; rows that are due plan anew."""
        if wanted is not self._wanted:
            self._make_room(wanted)
        due = ask_or_fly(False, tick, arrays, self._planner)
        if due:
            for first in range(0, due, _ROWS):
                self._plan(tick, arrays, first, min(first + _ROWS, due))
            ask_or_fly(True, tick, arrays, self._planner)

    def quickly(self, quick: Quick) -> Callable[[], int]:
        displacement, acceleration = (np.zeros_like(self._plans.displacement) for _ in _OUTPUTS)
        outputs = dict(zip(_OUTPUTS, (displacement, acceleration), strict=True))
        telling = Telling(
            self.shown_after,
            as_bytes(self.shown_after.astype("<u2")),
            self._now,
            self._shown,
            as_bytes(self._shown),
        )
        begin, end = (
            bound(fly_quickly, planned, quick, self._planner, displacement, acceleration, telling)
            for planned in (False, True)
        )
        plan = session.bound(self._session, self._asked(0, 1), outputs)

        def fly() -> int:
            size = begin()
            if size == DUE:
                plan()
                size = end()
            return size

        return fly

    def _asked(self, first: int, end: int) -> dict[str, NDArray[np.float32]]:
        return {name: getattr(self._question, name)[first:end] for name in self._inputs}

    def _plan(self, tick: int, arrays: TickArrays, first: int, end: int) -> None:
        displacement, acceleration = self._session.run(_OUTPUTS, self._asked(first, end))
        take_plans(tick, first, arrays, self._planner, displacement, acceleration)

    def plans(self, tick: int) -> NDArray[np.float32]:
        """As the base class: at P = `SHOWN` moments, evenly over what was planned last."""
        self._now[0] = tick
        self._show(self._now, self.shown_after, self._plans, self._shown)
        return self._shown.copy()

    def forget(self, row: int) -> None:
        """Row ``row`` knows nothing any more: neither what it saw nor what it planned."""
        if row < len(self._plans.made_at):
            self._history.blank[row] = True
            self._plans.made_at[row] = NEVER
