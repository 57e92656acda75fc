"""The mission: everything that decides a flight, in one validated, frozen document.

A mission file is YAML with the fields of protocols.mission.fields; every field has a default, so an empty file is the standard
task (docs/task.md). No text becomes a number, no number a truth. A wrong mission is refused with the field and what would be
right: fields alone there and in protocols.mission.values, what they say about each other in protocols.mission.checks.
"""

from pathlib import Path
from typing import Any

from pydantic import ValidationError, model_validator

from protocols.dynamics import ticks_of
from protocols.errors import SwarmError
from protocols.mission import needs
from protocols.mission.checks import check_mission
from protocols.mission.fields import MissionFields, Obstacles
from protocols.mission.findings import explain_as
from protocols.mission.policy_name import from_folder


class MissionError(SwarmError, ValueError):
    """A mission that cannot be flown; the text is one line: the field, what is wrong, what would be right."""


class Mission(MissionFields):
    """One flight: its fields, what follows from them, and that it can be flown.

    Raises:
        pydantic.ValidationError: it cannot (`parse_mission` says it in one line).
    """

    @property
    def limit_ticks(self) -> int:
        """Ticks until a whole flight counts as failed."""
        return needs.limit_ticks(self)

    @property
    def ticks(self) -> int:
        """Ticks until this flight, or the beginning that is asked for, counts as failed."""
        return self.limit_ticks if self.fly_s is None else min(self.limit_ticks, ticks_of(self.fly_s))

    @property
    def frame_every(self) -> int:
        """Ticks from one frame of a drone to its next."""
        return needs.frame_ticks(self.radio.frame_rate_hz)

    @property
    def memory_ticks(self) -> int:
        """How long a neighbour's last frame is believed."""
        usual = max(ticks_of(needs.USUAL_MEMORY_S), needs.memory_ticks(self.radio))
        return usual if self.radio.memory_s is None else ticks_of(self.radio.memory_s)

    @property
    def answer_ticks(self) -> int:
        """How long a proposal waits for its answer."""
        usual = max(ticks_of(needs.USUAL_ANSWER_S), needs.answer_ticks(self.radio))
        return usual if self.swap.answer_s is None else ticks_of(self.swap.answer_s)

    @property
    def silent_ticks(self) -> int:
        """A drone unheard by everyone for this long has left its slot."""
        usual = needs.usual_silence_ticks(self.radio, self.agents)
        return usual if self.swap.silent_s is None else ticks_of(self.swap.silent_s)

    @property
    def told(self) -> "Mission":
        """The mission as a drone knows it: nothing from which the field or the future could be told before they are met."""
        hidden = {"name": "told", "map_seed": 0, "seed": 0, "obstacles": Obstacles(discs=()), "faults": ()}
        return self.model_copy(update=hidden)

    def briefing(self) -> dict[str, Any]:
        """What a world tells its drones of the mission, as plain fields. Which policy a drone flies it does not say."""
        return self.told.model_dump(mode="json", exclude={"policy"})

    @model_validator(mode="after")
    def _flyable(self) -> "Mission":
        check_mission(self)
        return self


def explain(error: ValidationError) -> str:
    """Pydantic's findings about a mission as one line: field, what is wrong, what would be right."""
    return explain_as(Mission, error)


def parse_mission(fields: dict[str, Any], source: str = "mission") -> Mission:
    """A mission from plain fields, e.g. of a YAML file or JSON message.

    Raises:
        MissionError: one line, naming ``source``, the field and what would be right.
    """
    try:
        return Mission.model_validate(fields)
    except ValidationError as error:
        raise MissionError(f"{source}: {explain(error)}") from None


def parse_briefing(fields: dict[str, Any], policy: str) -> Mission:
    """The mission of a drone that was told ``fields`` and flies ``policy``, whatever it was told of policies.

    Raises:
        MissionError: as parse_mission.
    """
    return parse_mission({**fields, "policy": policy}, "the world's mission")


def read_mission_fields(path: Path) -> dict[str, Any]:
    """The fields written in a mission file, unvalidated, for merging with command-line options. A policy's file counts from
    the folder of the mission file.

    Raises:
        MissionError: the file is missing, unreadable, or not a YAML mapping.
    """
    from protocols.mission.reading import ReadingError, read_yaml_file  # loads what only files need

    try:
        fields = read_yaml_file(path)
    except ReadingError as error:
        raise MissionError(str(error)) from None
    if isinstance(fields.get("policy"), str):
        fields["policy"] = from_folder(fields["policy"], path.parent)
    return fields


def mission_yaml(mission: Mission) -> str:
    """The mission as YAML, every field; reading it gives an equal mission."""
    from protocols.mission.reading import write_yaml

    return write_yaml(mission.model_dump(mode="json"))
