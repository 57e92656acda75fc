"""The budget of a campaign: how much may go wrong in one flight."""

from dataclasses import asdict, dataclass, replace

from protocols.dynamics import ticks_of
from protocols.mission.document import Mission, MissionError, parse_mission
from protocols.mission.fields import Radio

TROUBLES = ("kill", "freeze", "hang", "restart", "part", "slow", "spell", "lie")
WEATHER = ("loss", "burst", "delay_ms", "jitter_ms", "duplicate", "reorder")


@dataclass(frozen=True)
class Budget:
    """At most so much in one flight. Troubles begin within ``until_s``; each ends by itself, but a kill.

    kill: drones that die. freeze: drones that hang for up to ``freeze_s`` and go on. hang: that hang as long and are then
    restarted. restart: that lose their memory in flight. part: times that the radio is split in two, for up to ``part_s``. slow:
    drones that have at least ``slow_factor`` of their limits for up to ``slow_s``. spell: times that the radio loses up to
    ``spell_loss`` of all frames, for up to ``spell_s``. lie: drones that lie by radio for up to
    ``lie_s``. The rest are the worst of the mission's radio.
    """

    kill: int = 1
    freeze: int = 1
    hang: int = 1
    restart: int = 1
    part: int = 1
    slow: int = 1
    spell: int = 1
    lie: int = 0
    loss: float = 0.2
    burst: float = 0.3
    delay_ms: float = 20.0
    jitter_ms: float = 20.0
    duplicate: float = 0.1
    reorder: float = 0.1
    until_s: float = 6.0
    freeze_s: float = 0.5
    part_s: float = 3.0
    slow_s: float = 5.0
    slow_factor: float = 0.5
    spell_s: float = 3.0
    spell_loss: float = 0.5
    lie_s: float = 3.0

    def __str__(self) -> str:
        """As it is written on the command line."""
        return ",".join(f"{name}={value:g}" for name, value in asdict(self).items())

    @property
    def last_s(self) -> float:
        """When the last trouble is over at the latest."""
        lasting = (
            (self.freeze or self.hang, self.freeze_s),
            (self.part, self.part_s),
            (self.slow, self.slow_s),
            (self.spell, self.spell_s),
            (self.lie, self.lie_s),
        )
        return self.until_s + max(seconds for allowed, seconds in (*lasting, (1, 0.0)) if allowed)


_MOST = {
    **dict.fromkeys(TROUBLES, 20),
    **dict.fromkeys(("loss", "burst", "duplicate", "reorder", "spell_loss"), 1),
    "slow_factor": 0.99,
    **dict.fromkeys(("delay_ms", "jitter_ms"), 500),
    **dict.fromkeys(("until_s", "freeze_s", "part_s", "slow_s", "spell_s", "lie_s"), 600),
}

_LEAST = dict.fromkeys(("slow_factor", "spell_loss"), 0.01)  # of the rest 0; both are drawn in hundredths


def parse_budget(text: str | None) -> Budget:
    """A budget from ``kill=2,burst=0.5``: what is named, instead of the usual; ``none`` first: instead of nothing.

    Raises:
        MissionError: one line says what would be right.
    """
    if not isinstance(text, str | None):
        raise MissionError(f"budget: give text such as 'none,kill=2', not {text!r}")
    words = [word.strip() for word in text.split(",")] if text else []
    budget = Budget()
    if words[:1] == ["none"]:
        budget = replace(budget, **dict.fromkeys((*TROUBLES, *WEATHER), 0))
        words = words[1:]
    known = {name: type(value) for name, value in asdict(Budget()).items()}
    for word in words:
        name, _, number = word.partition("=")
        if name not in known:
            raise MissionError(
                f"--budget {word}: write NAME=NUMBER, where NAME is one of {', '.join(known)}, or none"
            )
        try:
            value = known[name](number)
            if not _LEAST.get(name, 0) <= value <= _MOST[name]:
                raise ValueError
            if name.endswith("_s"):
                value = round(value, 2)
        except ValueError:
            kind = "a whole number" if known[name] is int else "a number"
            raise MissionError(
                f"--budget {word}: give {kind} from {_LEAST.get(name, 0)} to {_MOST[name]}"
            ) from None
        budget = replace(budget, **{name: value})
    return budget


def ready(mission: Mission, budget: Budget) -> Mission:
    """The mission as a campaign flies it: with as much more time as the budget's troubles may take.

    Raises:
        MissionError: it cannot be flown with this budget.
    """
    if budget.kill >= mission.agents:
        raise MissionError(f"--budget kill={budget.kill}: leaves none of {mission.agents} drones; give less")
    longer = round(mission.limit_ticks + ticks_of(budget.last_s)) / 100
    return parse_mission({**dict(mission), "time_limit_s": longer}, "campaign")


def spoilt(radio: Radio, weather: dict[str, float]) -> Radio:
    """The radio with so much worse of each of `WEATHER`: whichever is worse, the mission's own or this."""
    worse = {name: max(value, getattr(radio, name)) for name, value in weather.items() if name != "burst"}
    burst = radio.burst.model_copy(update={"loss": max(radio.burst.loss, weather.get("burst", 0.0))})
    return radio.model_copy(update={**worse, "burst": burst})
