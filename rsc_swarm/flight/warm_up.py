"""Everything that a flight needs is loaded, or compiled, before it begins.

A policy of one's own is tried apart first (rsc_swarm.flight.apart): one that does not return from its first tick can be ended.
"""

from collections.abc import Callable
from functools import lru_cache, partial

from agent.policy.registry import policy_names
from agent.process import rehearse
from protocols.mission.document import Mission
from rsc_swarm.flight.apart import Apart, is_own
from rsc_swarm.flight.drones_apart import flown_by
from rsc_swarm.flight.policy_facts import may_leave


def warm_up(mission: Mission) -> None:
    """Load (or on the very first run compile) every kernel that flying ``mission`` needs; what must not be forked stays closed.

    Raises:
        world.field.FieldError, PolicyError: it cannot be flown. KeyboardInterrupt: asked to leave meanwhile.
    """
    with (
        may_leave() as leave,
        flown_by(mission.model_copy(update={"faults": ()}), leave, True) as (director, _),
    ):
        director.tick()


def warm_up_drone(mission: Mission) -> None:
    """The same for what a drone's own process needs.

    Raises:
        PolicyError: it cannot be flown. KeyboardInterrupt: asked to leave meanwhile.
    """
    try_policy(mission.policy, partial(rehearse, mission))
    rehearse(mission)


def warm_up_launch(mission: Mission) -> None:
    """Both, for a launch, which forks all its processes from this one.

    Launches of one mission in a row do it once: each time would leave a little memory in pieces, which all of them then carry. A
    policy that is a file may have changed meanwhile, so it is tried again.

    Raises:
        world.field.FieldError, PolicyError, KeyboardInterrupt: as those.
    """
    (_once if mission.policy in policy_names() else _both)(mission)


def _both(mission: Mission) -> None:
    warm_up(mission)
    warm_up_drone(mission)


_once = lru_cache(maxsize=1)(_both)


def try_policy(policy: str, work: Callable[[], object]) -> None:
    """Do this work where it can be left, if it is that of somebody's own policy, before this process does it.

    Raises:
        PolicyError: as `Apart`; and whatever ``work`` raises. KeyboardInterrupt: asked to leave meanwhile.
    """
    if is_own(policy):
        with may_leave() as leave, Apart(work, policy, leave):
            pass
