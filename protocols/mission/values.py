"""The kinds of values a mission is made of. Nothing turns into something else: no text into a number, no truth into 1."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, Strict

from protocols.dynamics import TICK_S

LONGEST_S = 3600.0  #: no time of a mission is longer
_FARTHEST = 1e6  # no number of a mission is larger
_WORDS = {"yes": True, "on": True, "no": False, "off": False}


class Section(BaseModel):
    """A part of a mission: frozen, and without fields it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def _truth(value: object) -> object:
    """What people write for true and false."""
    return _WORDS.get(value.lower(), value) if isinstance(value, str) else value


def _whole_ticks(seconds: float) -> float:
    ticks = seconds / TICK_S
    if abs(ticks - round(ticks)) > 1e-6:
        raise ValueError(
            f"{seconds:.10g} s is no whole number of ticks of {TICK_S:g} s; give {round(ticks) * TICK_S:.2f}"
        )
    return seconds


def _one_line(text: str) -> str:
    if not text.isprintable():
        raise ValueError("write one line of printable text")
    return text


Flag = Annotated[bool, BeforeValidator(_truth), Strict()]
Number = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Count = Annotated[int, Strict()]
Line = Annotated[str, Strict(), Field(min_length=1, max_length=4096), AfterValidator(_one_line)]
Probability = Annotated[Number, Field(ge=0, le=1)]
Positive = Annotated[Number, Field(gt=0, le=_FARTHEST)]
NotNegative = Annotated[Number, Field(ge=0, le=_FARTHEST)]
Place = Annotated[Number, Field(ge=-_FARTHEST, le=_FARTHEST)]
Seconds = Annotated[Number, Field(ge=0, le=LONGEST_S), AfterValidator(_whole_ticks)]
Span = Annotated[Number, Field(ge=TICK_S, le=LONGEST_S), AfterValidator(_whole_ticks)]
Number32 = Annotated[Count, Field(ge=0, lt=2**32)]
Who = Annotated[Count, Field(ge=0)]
Point = tuple[Place, Place]
