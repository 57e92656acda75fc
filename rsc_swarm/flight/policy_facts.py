"""What a command wants to know of a mission's policy before it flies it."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

from agent.policy import files_of, find_policy
from protocols.mission.document import Mission
from rsc_swarm.flight.apart import Apart, is_own
from rsc_swarm.machine.leaving import Leave, leave_when_asked


class PolicyFacts(NamedTuple):
    """files: those besides the project's own code that decide what it does. many_flights: as agent.policy.Policy says."""

    files: tuple[Path, ...]
    many_flights: bool


def policy_facts(mission: Mission) -> PolicyFacts:
    """What the mission's policy is; somebody's own is made apart, since whatever it does then, one must be able to leave.

    Raises:
        PolicyError: it cannot be found or made. KeyboardInterrupt: asked to leave meanwhile.
    """
    if not is_own(mission.policy):
        return _Made(mission).facts()
    with may_leave() as leave, Apart(partial(_Made, mission), mission.policy, leave) as made:
        facts: PolicyFacts = made.call("facts")
    return facts


@contextmanager
def may_leave() -> Iterator[Leave]:
    """As leave_when_asked, where there is nothing to tell or keep yet."""
    with leave_when_asked() as leave:
        yield leave
    if leave.asked:
        raise KeyboardInterrupt


class _Made:
    def __init__(self, mission: Mission) -> None:
        self._policy = find_policy(mission.policy, mission)

    def facts(self) -> PolicyFacts:
        return PolicyFacts(files_of(self._policy), bool(getattr(self._policy, "many_flights", False)))
