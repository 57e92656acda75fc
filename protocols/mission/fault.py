"""Faults: what a mission lets go wrong, when, and to whom."""

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from protocols.dynamics import ticks_of
from protocols.mission.values import Number, Probability, Seconds, Section, Who

#: What a drone may be made to say by radio (protocols.wire.lies).
LieName = Literal[
    "position", "impossible-motion", "displacement", "observation", "all-alive", "digest", "replay", "forged-swaps",
    "forged-checkpoint",
]  # fmt: skip
_USUAL_FACTOR = 0.5


class Fault(Section):
    """Something that happens to the swarm at a given time."""

    at_s: Seconds
    kind: Literal[
        "kill", "freeze", "thaw", "restart", "part", "heal", "slow", "recover", "loss", "lie", "truth"
    ]  # fmt: skip
    agents: tuple[Who, ...] = ()
    slots: tuple[Who, ...] = Field((), description="whoever holds these slots at the start")
    groups: tuple[tuple[Who, ...], ...] = Field((), description="for part: who hears whom")
    factor: Annotated[Number, Field(gt=0, le=1)] = Field(
        _USUAL_FACTOR, description="for slow: share of the limits that is left"
    )

    loss: Probability | None = Field(
        None, description="for loss: share of frames that the radio loses from now on"
    )
    lie: LieName | None = Field(None, description="for lie: what the drone says by radio from now on")

    @property
    def at_tick(self) -> int:
        """The tick at whose beginning it happens."""
        return ticks_of(self.at_s)

    @model_validator(mode="after")
    def _complete(self) -> "Fault":
        whose = self.kind not in ("part", "heal", "loss")
        if self.kind == "part" and len(self.groups) < 2:
            raise ValueError("groups: a part needs at least two groups of agents")
        if self.kind == "loss" and self.loss is None:
            raise ValueError("loss: say which share of frames is lost, for example 0.3")
        if self.kind == "lie" and self.lie is None:
            raise ValueError(f"lie: say which, one of {', '.join(get_args(LieName))}")
        if whose and not (self.agents or self.slots):
            raise ValueError(f"agents: name at least one agent (or slot) to {self.kind}")
        for field, idle in (
            ("agents", not whose and self.agents),
            ("slots", not whose and self.slots),
            ("groups", self.kind != "part" and self.groups),
            ("factor", self.kind != "slow" and self.factor != _USUAL_FACTOR),
            ("loss", self.kind != "loss" and self.loss is not None),
            ("lie", self.kind != "lie" and self.lie is not None),
        ):
            if idle:
                raise ValueError(f"{field}: means nothing to {self.kind}; leave it out")
        grouped = [agent for group in self.groups for agent in group]
        if len(set(grouped)) < len(grouped):
            twice = min(agent for agent in grouped if grouped.count(agent) > 1)
            raise ValueError(f"groups: agent {twice} is named twice; give it to one group")
        if not all(self.groups):
            raise ValueError("groups: a group is empty; name its agents, or leave it out")
        return self
