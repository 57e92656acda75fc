"""The training config: everything that decides a trained policy, in one validated, frozen document.

Three are known by name: ``default``, which ships, ``paper``, the paper's to the letter (docs/paper.md), and ``stgnn``, the
baseline, taught in the same way. A file with a config is YAML with the fields below on top of one of these. Units are in the
names.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from protocols.dynamics import TICK_S
from protocols.errors import SwarmError
from protocols.mission.findings import explain_as
from protocols.mission.reading import ReadingError, read_yaml_file
from protocols.mission.values import Count as Whole
from protocols.mission.values import Flag, NotNegative, Number, Positive, Probability

Count = Annotated[Whole, Field(ge=1)]
PAST = 3  # past steps that are recorded
_EPISODE_TICKS = 2100


class TrainingError(SwarmError, ValueError):
    """A training that cannot be begun or gone on with; one line says what is wrong and what would be right."""


class TrainingConfig(BaseModel):
    """How a policy is shaped and trained."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    # The policy.
    kind: Literal["rsc", "stgnn"] = "rsc"
    horizon: Annotated[Whole, Field(ge=1, le=100)] = Field(20, description="planned steps H, 10 ms each")
    replan_ticks: Count | None = Field(None, description="ticks between plans when flown; H if not given")
    output: Literal["knots", "raw", "action"] = Field(
        "knots",
        description="knots: an acceleration, piecewise linear over the horizon; raw: H x 2 displacements (the paper); "
        "action: the acceleration of one tick",
    )
    knots: Annotated[Whole, Field(ge=2, le=20)] = Field(
        4, description="knots of the acceleration; one at H = 1"
    )
    extra: Literal["none", "wide"] = Field(
        "wide", description="wide: four obstacles, five neighbours besides X_i"
    )
    past: Annotated[Whole, Field(ge=1, le=PAST)] = Field(PAST, description="past steps L")
    aggregation: Literal["ticks", "hops"] = Field(
        "ticks",
        description="what is known of the neighbours (paper, Eqs. 3, 4); ticks: the mean of their X in each of the last L ticks; "
        "hops: L rounds over the air, means of means, a tick a hop",
    )
    width: Annotated[Whole, Field(ge=4, le=1024)] = 128
    heads: Count = 4
    feedforward: Count = 256
    dropout: Annotated[Number, Field(ge=0, lt=1)] = Field(0.0, description="of the local-formation stream")

    # What is flown for the data.
    flown: Literal["ours", "paper"] = Field(
        "ours",
        description="ours: with the safety filter, plans broken off; paper: as in mission paper, every plan to its end",
    )
    expert: Literal["ours", "paper"] = Field(
        "ours", description="who labels: ours, or the paper's three terms"
    )
    maps: Count | None = Field(None, description="number of fields; none: a new one for every episode")
    agents: Annotated[Whole, Field(ge=2, le=100)] = 25
    hard_share: Probability = Field(
        0.65, description="share of fields with 12 to 14 obstacles instead of 3 to 6"
    )
    detour_share: Probability = Field(
        0.5, description="share of epochs flown with detours; without, it learns what to do where it stops"
    )
    worlds: Count = Field(64, description="episodes flown in step")
    parts: Count = Field(
        1,
        description="parts in which they are flown, each with chance of its own, so that as many workers can fly at once",
    )
    rounds: Count | None = Field(
        150, description="plans per epoch and world; each gives one graph of N samples; none: as 21 s hold"
    )
    mixing_rule: Literal["linear", "paper"] = Field(
        "linear",
        description="how the expert's share falls; paper: max(.99^max(n - 1000, 0), .1) after n episodes, its epochs",
    )
    mixing: tuple[Probability, Probability] = Field(
        (1.0, 0.1),
        description="share of plans the expert flies: first epoch, and after mixing_share of the epochs",
    )
    mixing_share: Probability = 0.15

    # How it is learned.
    epochs: Count = 20
    updates: Count = Field(480, description="per epoch")
    replay: Count = Field(200_000, description="graphs that are kept; the oldest go first")
    batch: Count = Field(40, description="graphs per update")
    learning_rate: Positive = 5e-4
    cosine: Flag = Field(True, description="the learning rate falls to zero as a cosine")
    weight_decay: NotNegative = Field(0.05, description="l2, apart from the gradient (AdamW)")
    averaging: Annotated[Number, Field(ge=0, lt=1)] = Field(
        0.999, description="decay of the averaged weights"
    )
    mirror: Flag = Field(
        True, description="half of all graphs are learned as seen in a mirror along the motion"
    )
    position_weight: NotNegative = 1.0
    velocity_weight: NotNegative = 1.0
    outlier_mps2: Positive | None = Field(
        0.5,
        description="errors beyond this count by their size instead of its square (Huber); none: all by squares",
    )
    clip: Positive | None = Field(1.0, description="longest gradient; a longer one is shortened to it")
    validation_maps: Whole = Field(
        0, ge=0, le=64, description="fields on which the error is measured that nothing is learned from"
    )
    plateau: Flag = Field(
        False, description="end where the validation error got better by less than 1 % in the last fifth"
    )
    bfloat16: Flag = Field(True, description="multiply in bfloat16 where the processor can")
    float16: Flag = Field(False, description="the model file keeps weights in half precision: half its size")
    seed: Annotated[Whole, Field(ge=0, lt=2**31)] = 0

    @property
    def name(self) -> str:
        """What the model is called: rsc-h20, stgnn."""
        return f"rsc-h{self.horizon}" if self.kind == "rsc" else self.kind

    @property
    def duration_s(self) -> float:
        """T = H dt."""
        return self.horizon * TICK_S

    @property
    def replan(self) -> int:
        """Ticks between plans when flown."""
        return self.replan_ticks or self.horizon

    @property
    def fly_ticks(self) -> tuple[int, int]:
        """Between how many ticks a plan is flown for the data: often also past re-planning at half the horizon. The paper's to
        its end."""
        return (self.horizon, self.horizon) if self.flown == "paper" else (10, max(20, self.horizon))

    @property
    def plans(self) -> int:
        """Plans per epoch and world."""
        return self.rounds or -(-_EPISODE_TICKS // self.horizon)

    @property
    def knot_count(self) -> int:
        """Knots of the acceleration."""
        return min(self.knots, self.horizon)

    @model_validator(mode="after")
    def _trainable(self) -> "TrainingConfig":
        if self.kind == "stgnn" and self.output != "action":
            raise ValueError(f"output: stgnn acts for one tick; give action, not {self.output}")
        if self.output == "action" and self.horizon != 1:
            raise ValueError(f"horizon: output action is for one tick; give 1, not {self.horizon}")
        if self.replan > self.horizon:
            raise ValueError(
                f"replan_ticks: {self.replan} is beyond the horizon; give at most {self.horizon}"
            )
        if self.width % self.heads:
            raise ValueError(f"width: {self.width} is not a multiple of {self.heads} heads")
        if self.parts > self.worlds:
            raise ValueError(f"parts: there are not so many episodes; give at most {self.worlds}")
        if self.replay < self.worlds * self.plans:
            raise ValueError(f"replay: holds less than an epoch; give at least {self.worlds * self.plans}")
        if self.plateau and not self.validation_maps:
            raise ValueError("plateau: is seen in the validation error; give validation_maps as well")
        if self.flown == "paper" and self.hard_share:
            raise ValueError("hard_share: flown as in the paper, fields have 3 to 6 obstacles; give 0")
        if self.output != "raw" and self.position_weight == self.velocity_weight == 0:
            raise ValueError("velocity_weight: with position_weight 0 as well there is nothing to learn")
        if self.output == "raw" and not self.position_weight:
            raise ValueError("position_weight: output raw learns positions only; give more than 0")
        return self


_PAPER: dict[str, Any] = {
    "output": "raw",
    "extra": "none",
    "width": 256,
    "dropout": 0.1,
    "flown": "paper",
    "expert": "paper",
    "maps": 500,
    "hard_share": 0.0,
    "detour_share": 0.0,
    "worlds": 20,  # an epoch here is twenty of the paper's: one episode each
    "rounds": None,
    "mixing_rule": "paper",
    "epochs": 200,
    "updates": 240,
    "replay": 400_000,
    "learning_rate": 3e-4,
    "cosine": False,
    "weight_decay": 0.0,
    "averaging": 0.0,
    "mirror": False,
    "velocity_weight": 0.0,
    "outlier_mps2": None,
    "clip": 1.0,  # without it a training collapsed (docs/paper.md)
    "validation_maps": 8,
    "plateau": True,
    "float16": True,
}
PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "paper": _PAPER,
    "stgnn": {**_PAPER, "kind": "stgnn", "horizon": 1, "output": "action", "aggregation": "hops"},
}


def make_config(preset: str, file: Path | None, **given: Any) -> TrainingConfig:
    """The preset, then the fields of ``file``, then those given that are not None.

    Raises:
        TrainingError: an unknown preset or field, a bad value, an unreadable file.
    """
    if preset not in PRESETS:
        raise TrainingError(f"--preset {preset}: no such preset; known: {', '.join(PRESETS)}")
    try:
        written = read_yaml_file(file) if file else {}
    except ReadingError as error:
        raise TrainingError(str(error)) from None
    given = {name: value for name, value in given.items() if value is not None}
    source = f"{file}: " if file else ""
    try:
        return TrainingConfig.model_validate({**PRESETS[preset], **written, **given})
    except ValidationError as error:
        raise TrainingError(source + explain_as(TrainingConfig, error)) from None
