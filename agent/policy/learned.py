"""Learned policies: a model file plans a trajectory now and then, and the drone flies it meanwhile.

The files rsc-h1 ... rsc-h40 and stgnn come with the project; any other is given by its path.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.control.follow import following_of
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
from agent.policy.model_file import ModelFileError, ModelNote, note_of, read_model
from agent.policy.network import Network
from agent.quick import Quick
from agent.tick_arrays import TickArrays
from protocols.kernels import bound, by_reference, rebound
from protocols.mission.document import Mission
from protocols.relative import NEVER
from protocols.wire.planned import SHOWN
from protocols.wire.rows import as_bytes

if TYPE_CHECKING:
    from agent.policy.session import Session


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
        self.rounds = facts.rounds
        self._opened: Network | Session
        self._show, self._now = rebound(show_plans), np.zeros(1, np.int64)
        self._make_room(np.zeros((0, 2)))

    def _make_room(self, wanted: NDArray[np.float64]) -> None:
        facts, rows = self.model.facts, len(wanted)
        neighbours = 0 if facts.rounds else facts.neighbours
        self._history = empty_history(rows, facts.past, neighbours)
        self._question = empty_question(rows, facts.past, neighbours, facts.rounds)
        self._plans = empty_plans(rows, facts.horizon)
        self.made_at = self._plans.made_at if facts.horizon > 1 else None
        self._planned = self._plans.displacement.copy(), self._plans.acceleration.copy()
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
        facts, data = self.model.facts, self.model.data
        try:
            self._opened = Network(facts, data) if facts.network else _foreign(facts, data)
        except (ModelFileError, RuntimeError) as error:
            raise PolicyError(f"policy: {self.model.path}: cannot be run ({error})") from None

    def act_on_arrays(self, tick: int, arrays: TickArrays, wanted: NDArray[np.float64]) -> None:
        """As the base class; rows that are due plan anew."""
        if wanted is not self._wanted:
            self._make_room(wanted)
        due = ask_or_fly(False, tick, arrays, self._planner)
        if due:
            self._opened.plan(0, due, self._question, *self._planned)
            take_plans(tick, due, arrays, self._planner, *self._planned)
            ask_or_fly(True, tick, arrays, self._planner)

    def quickly(self, quick: Quick) -> Callable[[], int]:
        telling = Telling(
            self.shown_after,
            as_bytes(self.shown_after.astype("<u2")),
            self._now,
            self._shown,
            as_bytes(self._shown),
        )
        begin, end = (
            bound(fly_quickly, planned, quick, self._planner, *self._planned, telling)
            for planned in (False, True)
        )
        plan = self._opened.bound(self._question, *self._planned)

        def fly() -> int:
            size = begin()
            if size == DUE:
                plan()
                size = end()
            return size

        return fly

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


def _foreign(note: ModelNote, data: bytes) -> "Session":
    """Raises RuntimeError if it cannot be run."""
    from agent.policy.session import Session  # loads ONNX Runtime, which a network of ours does without

    return Session(note, data)
