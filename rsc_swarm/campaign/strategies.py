"""What Hypothesis draws: missions in which things go wrong, within a budget.

Simpler is nearer to nothing going wrong, early: so Hypothesis shrinks towards the mission itself.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from pydantic import ValidationError

from protocols.dynamics import TICK_S, ticks_of
from protocols.mission.document import Mission
from protocols.mission.fault import LieName
from protocols.mission.fields import Radio
from rsc_swarm.campaign.budget import WEATHER, Budget, ready, spoilt

MAPS = 1_000_000  # as many, from there on: none of them is among the maps of the tables
_WEATHERS = 1  # besides the mission's own, in one task

_TOGETHER = 50  # ticks between troubles that come together, at most

Trouble = list[dict[str, Any]]  # faults that belong together, such as freeze and thaw


@dataclass(frozen=True)
class Schedule:
    """A mission without the trouble that was drawn for it, and that, one after the other."""

    calm: Mission
    troubles: tuple[Trouble, ...]

    @property
    def mission(self) -> Mission:
        """What is flown: with all trouble, but what would do nothing after that before it."""
        mission = self.calm
        for faults in self.troubles:
            later = sorted([*mission.faults, *faults], key=_when)
            mission = _checked(mission, {"faults": later}) or mission
        return mission


def missions(mission: Mission, budget: Budget, weathers: int = 0) -> SearchStrategy[Mission]:
    """The missions of `schedules`."""
    return schedules(mission, budget, weathers).map(lambda schedule: schedule.mission)


def schedules(mission: Mission, budget: Budget, weathers: int = 0) -> SearchStrategy[Schedule]:
    """``mission`` on other maps, from other starts, with more faults and a worse radio, as the budget allows.

    Args:
        weathers: a number that decides which few radios are drawn from; flights with one radio fly in step.

    Raises:
        protocols.mission.document.MissionError: the mission cannot be flown with this budget.
    """
    longer = ready(mission, budget)
    rng = np.random.default_rng(weathers)
    radios = [longer.radio, *(spoilt(longer.radio, _weather(budget, rng)) for _ in range(_WEATHERS))]
    flyable = [radio for radio in radios if _checked(longer, {"radio": radio})]
    seeds = st.integers(MAPS, 2 * MAPS - 1)

    def made(troubles: tuple[Trouble, ...], radio: Radio, map_seed: int, seed: int) -> Schedule:
        fields = {"radio": radio, "map_seed": map_seed, "seed": seed}
        return Schedule(longer.model_copy(update=fields), tuple(_under(radio, faults) for faults in troubles))

    return st.builds(made, _troubles(longer, budget), st.sampled_from(flyable), seeds, seeds)


def _weather(budget: Budget, rng: np.random.Generator) -> dict[str, float]:
    """Some of what may be wrong with the radio, each as bad as chance has it."""
    digits = {"delay_ms": -1, "jitter_ms": -1}
    return {
        name: round(float(rng.uniform(0, getattr(budget, name))), digits.get(name, 2))
        for name in WEATHER
        if rng.random() < 0.5
    }


def _when(fault: Any) -> float:
    return float(fault["at_s"] if isinstance(fault, dict) else fault.at_s)


def _checked(mission: Mission, fields: dict[str, Any]) -> Mission | None:
    try:
        return Mission.model_validate({**dict(mission), **fields})
    except ValidationError:
        return None


def _troubles(mission: Mission, budget: Budget) -> SearchStrategy[tuple[Trouble, ...]]:
    """Half of the troubles come together: to one drone, and about one moment, which is likely to be an early one, while slots
    are traded most. What goes wrong alone is mostly survived."""
    everyone, last = st.integers(0, mission.agents - 1), ticks_of(budget.until_s)
    anytime = st.integers(0, last)
    drone, begin = everyone | st.none(), anytime | st.integers(0, _TOGETHER).map(_After)

    def lasting(longest_s: float) -> SearchStrategy[int]:
        return st.integers(1, max(1, ticks_of(longest_s)))

    kinds = {
        "kill": st.builds(_one("kill"), drone, begin),
        "freeze": st.builds(_pair("freeze", "thaw"), drone, begin, lasting(budget.freeze_s)),
        "hang": st.builds(_pair("freeze", "restart"), drone, begin, lasting(budget.freeze_s)),
        "restart": st.builds(_one("restart"), drone, begin),
        "part": st.builds(
            _part(mission.agents),
            st.sets(everyone, min_size=1, max_size=max(1, mission.agents - 1)),
            begin,
            lasting(budget.part_s),
        ),
        "slow": st.builds(
            _slow, drone, begin, lasting(budget.slow_s), st.integers(round(100 * budget.slow_factor), 99)
        ),
        "spell": st.builds(
            _spell,
            begin,
            lasting(budget.spell_s),
            st.integers(1, round(100 * budget.spell_loss)),
        ),
        "lie": st.builds(_lie, drone, begin, lasting(budget.lie_s), st.sampled_from(get_args(LieName))),
    }
    allowed = [
        st.lists(kinds[kind], max_size=getattr(budget, kind))
        for kind in kinds
        if getattr(budget, kind) and (kind != "part" or mission.agents > 1)
    ]

    def made(drone: int, moment: int, drafts: tuple[list[_Draft], ...]) -> tuple[Trouble, ...]:
        spot = _Spot(drone, moment, last)
        return tuple(draft(spot) for some in drafts for draft in some)

    return st.builds(made, everyone, anytime | st.integers(0, last // 4), st.tuples(*allowed))


class _After(NamedTuple):
    """When: so many ticks after the moment of `_Spot`."""

    ticks: int


class _Spot(NamedTuple):
    """Where troubles come together: at which drone, and from which tick on; none begins after ``last``."""

    drone: int
    moment: int
    last: int

    def who(self, drone: int | None) -> int:
        """Who is struck; None: the drone that all strikes."""
        return self.drone if drone is None else drone

    def when(self, begin: "int | _After") -> int:
        """The tick at which it begins."""
        return min(self.moment + begin.ticks, self.last) if isinstance(begin, _After) else begin


# What is drawn of a trouble before it is known where troubles come together: strategies that depended on that would be made, and
# checked by Hypothesis, anew for every mission, which took longer than to draw from them.
_Draft = Callable[[_Spot], Trouble]


def _at(tick: int, kind: str, **what: Any) -> dict[str, Any]:
    return {"at_s": round(tick * TICK_S, 2), "kind": kind, **what}


def _one(kind: str) -> Any:
    def draft(drone: int | None, begin: int | _After) -> _Draft:
        return lambda spot: [_at(spot.when(begin), kind, agents=[spot.who(drone)])]

    return draft


def _pair(first: str, second: str) -> Any:
    def draft(drone: int | None, begin: int | _After, lasting: int) -> _Draft:
        return lambda spot: _both(spot.when(begin), lasting, first, second, agents=[spot.who(drone)])

    return draft


def _both(begin: int, lasting: int, first: str, second: str, **what: Any) -> Trouble:
    return [_at(begin, first, **what), _at(begin + lasting, second, **what)]


def _slow(drone: int | None, begin: int | _After, lasting: int, percent: int) -> _Draft:
    def made(spot: _Spot) -> Trouble:
        slow, recover = _both(spot.when(begin), lasting, "slow", "recover", agents=[spot.who(drone)])
        return [{**slow, "factor": percent / 100}, recover]

    return made


def _lie(drone: int | None, begin: int | _After, lasting: int, name: str) -> _Draft:
    def made(spot: _Spot) -> Trouble:
        lie, truth = _both(spot.when(begin), lasting, "lie", "truth", agents=[spot.who(drone)])
        return [{**lie, "lie": name}, truth]

    return made


def _spell(begin: int | _After, lasting: int, percent: int) -> _Draft:
    def made(spot: _Spot) -> Trouble:
        lossy, over = _both(spot.when(begin), lasting, "loss", "loss", loss=percent / 100)
        return [lossy, {**over, "loss": 0.0}]

    return made


def _under(radio: Radio, faults: Trouble) -> Trouble:
    """The same with a radio that is worse by itself: no spell makes it better."""
    return [
        {**fault, "loss": max(fault["loss"], radio.loss)} if "loss" in fault else fault for fault in faults
    ]


def _part(agents: int) -> Any:
    def draft(apart: set[int], begin: int | _After, lasting: int) -> _Draft:
        groups = [sorted(apart), sorted(set(range(agents)) - apart)]

        def made(spot: _Spot) -> Trouble:
            tick = spot.when(begin)
            return [_at(tick, "part", groups=groups), _at(tick + lasting, "heal")]

        return made

    return draft
