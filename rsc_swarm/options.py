"""What is to be flown, as it is asked for: the options that many commands share, and how they become a mission.

An option overrides the mission file, which overrides the defaults. ``--set`` reaches every field that has no
option of its own. Nothing here imports the mission before a command asks, so that ``--help`` answers at once.
"""

import json
import re
import shlex
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from protocols.mission.policy_name import from_folder
from rsc_swarm.missions import mission_file, shipped_missions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from protocols.mission.document import Mission
    from protocols.mission.fault import Fault


class Formation(StrEnum):
    """Shapes a mission can ask for by name."""

    auto = "auto"
    square = "square"
    triangle = "triangle"
    vee = "vee"
    line = "line"


class Aim(StrEnum):
    """What a drone steers to."""

    slot = "slot"
    chain = "chain"


class Swap(StrEnum):
    """Who may trade slots."""

    off = "off"
    tree = "tree"
    contact = "contact"


def _policies() -> list[str]:
    from agent.policy import policy_names

    return policy_names()


_WHO, _RADIO = "Who flies what, where", "Radio"


@dataclass(frozen=True)
class MissionOptions:
    """Options that say what is flown. None: as the mission file has it."""

    mission: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|NAME",
            help="Mission file (YAML), or a shipped one: see [bold]rsc-swarm mission --list[/].",
            autocompletion=shipped_missions,
            rich_help_panel=_WHO,
        ),
    ] = None
    agents: Annotated[
        int | None,
        typer.Option("--agents", "-n", metavar="N", help="Number of drones. (25)", rich_help_panel=_WHO),
    ] = None
    formation: Annotated[
        Formation | None,
        typer.Option(
            metavar="SHAPE",
            help="auto, square, triangle, vee or line; auto fits N. (auto)",
            rich_help_panel=_WHO,
        ),
    ] = None
    map: Annotated[
        int | None, typer.Option(metavar="SEED", help="Seed of the obstacles. (0)", rich_help_panel=_WHO)
    ] = None
    seed: Annotated[
        int | None,
        typer.Option(metavar="SEED", help="Seed of start places and radio. (0)", rich_help_panel=_WHO),
    ] = None
    policy: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Controller: a known name, FILE.py:Class, a model file, or package.module:Class. (rsc-h20)",
            autocompletion=_policies,
            rich_help_panel=_WHO,
        ),
    ] = None
    aim: Annotated[
        Aim | None,
        typer.Option(
            help="Steer to the own slot, or to the leader's position plus offset. (slot)",
            rich_help_panel=_WHO,
        ),
    ] = None
    swap: Annotated[
        Swap | None,
        typer.Option(
            help="Who may trade slots: nobody, follower and leader, any in contact. (contact)",
            rich_help_panel=_WHO,
        ),
    ] = None
    frame_rate: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Frames per drone and second. (100)", rich_help_panel=_RADIO),
    ] = None
    loss: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Frames lost, independently, 0 to 1.", rich_help_panel=_RADIO),
    ] = None
    burst: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            help="Frames lost in bursts (Gilbert-Elliott), mean, 0 to 1.",
            rich_help_panel=_RADIO,
        ),
    ] = None
    delay_ms: Annotated[
        float | None,
        typer.Option(metavar="MS", help="Delay of every frame beyond its one tick.", rich_help_panel=_RADIO),
    ] = None
    jitter_ms: Annotated[
        float | None,
        typer.Option(metavar="MS", help="Random extra delay, up to this.", rich_help_panel=_RADIO),
    ] = None
    duplicate: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Frames that arrive twice, 0 to 1.", rich_help_panel=_RADIO),
    ] = None
    reorder: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE", help="Frames held back behind later ones, 0 to 1.", rich_help_panel=_RADIO
        ),
    ] = None
    set: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD=VALUE",
            help="Any field of the mission, e.g. [bold]--set hold_s=2 --set start.scrambled=true[/].",
            rich_help_panel=_WHO,
        ),
    ] = None


# Option -> field of the mission. Options of the same name as their field are left out.
_FIELD_OF = {
    "formation": "formation.shape",
    "map": "map_seed",
    "swap": "swap.rule",
    "frame_rate": "radio.frame_rate_hz",
    "burst": "radio.burst.loss",
    **{name: f"radio.{name}" for name in ("loss", "delay_ms", "jitter_ms", "duplicate", "reorder")},
}


def flag(name: str) -> str:
    """``delay_ms`` -> ``--delay-ms``."""
    return "--" + name.replace("_", "-")


def chosen(options: MissionOptions, *but: str) -> dict[str, Any]:
    """The options that were given, without those in ``but``."""
    given = {field.name: getattr(options, field.name) for field in fields(options)}
    return {name: value for name, value in given.items() if value not in (None, []) and name not in but}


def resolve(options: MissionOptions) -> "Mission":
    """The mission these options ask for.

    Raises:
        protocols.mission.document.MissionError: one line that names the option or field and what would be right.
    """
    from pydantic import ValidationError

    from protocols.mission.document import Mission, MissionError, explain, read_mission_fields

    source, document = "", {}
    if options.mission is not None:
        try:
            path = mission_file(options.mission)
        except MissionError as error:
            raise MissionError(f"--mission {error}") from None
        source, document = f"{options.mission}: ", read_mission_fields(path)
    flags = {}
    for name, value in chosen(options, "mission", "set").items():
        field = _FIELD_OF.get(name, name)
        flags[field] = flag(name)
        _put(document, field, str(value) if isinstance(value, StrEnum) else value)
    for text in options.set or []:
        field, value = _setting(text)
        for other, name in flags.items():
            if f"{field}.".startswith(f"{other}.") or other.startswith(f"{field}."):
                raise MissionError(f"--set {text}: {name} says something else of it; keep one")
        flags[field] = f"--set {field}"
        _put(document, field, value)
    try:
        return Mission.model_validate(document)
    except ValidationError as error:
        text = explain(error)
    named = text
    for field, name in flags.items():
        named = re.sub(rf"(^|; ){re.escape(field)}: ", rf"\g<1>{name}: ", named)
    raise MissionError(named if named != text else source + text)


def _setting(text: str) -> tuple[str, Any]:
    from protocols.mission.document import MissionError
    from protocols.mission.reading import ReadingError, read_yaml

    field, equals, value = text.partition("=")
    if not equals or not re.fullmatch(r"\w+(\.\w+)*", field):
        raise MissionError(f"--set {text}: write FIELD=VALUE, for example --set radio.memory_s=1")
    try:
        return field, read_yaml(value)
    except ReadingError as error:
        raise MissionError(f"--set {field}: the value {error}") from None


def _put(document: dict[str, Any], field: str, value: Any) -> None:
    """Set a dotted field, making sections on the way. A section that is no mapping is left to validation."""
    *sections, last = field.split(".")
    place = document
    for section in sections:
        inner = place.get(section)
        if inner is None:
            inner = place[section] = {}
        if not isinstance(inner, dict):
            return
        place = inner
    place[last] = value


def named(options: MissionOptions, mission: str | None) -> MissionOptions:
    """The options with the mission that a command was given without ``--mission``.

    Raises:
        protocols.mission.document.MissionError: one was given so too.
    """
    if mission is None:
        return options
    if options.mission is not None:
        from protocols.mission.document import MissionError

        raise MissionError(f"--mission {options.mission}: {mission} is given already; leave one of them out")
    return replace(options, mission=mission)


def anywhere(options: MissionOptions) -> MissionOptions:
    """The same options with all files by absolute paths, so that they mean the same in another folder."""
    policy, others = options.policy, []
    for text in options.set or []:
        field, value = _setting(text)
        if field == "policy" and isinstance(value, str):
            policy = value
        else:
            others.append(text)
    mission = options.mission
    if mission is not None and (mission not in shipped_missions() or Path(mission).is_file()):
        mission = str(Path(mission).absolute())
    if policy is not None:
        policy = from_folder(policy, Path.cwd())
    return replace(options, mission=mission, policy=policy, set=others or None)


def with_faults(options: MissionOptions, faults: "Sequence[Fault]") -> MissionOptions:
    """The same options with these faults instead of the mission's."""
    plain = [fault.model_dump(mode="json", exclude_defaults=True) for fault in faults]
    others = [text for text in options.set or [] if _setting(text)[0] != "faults"]
    return replace(options, set=[*others, f"faults={json.dumps(plain)}"])


def command_line(verb: str, options: MissionOptions, **instead: Any) -> str:
    """The command that does this again, in any folder; ``instead`` replaces options, e.g. ``map=3``."""
    words = ["rsc-swarm", verb]
    for name, value in {**chosen(anywhere(options)), **instead}.items():
        for item in value if isinstance(value, list) else [value]:
            words.append(flag(name))
            if item is not True:
                words.append(repr(item).removesuffix(".0") if isinstance(item, float) else str(item))
    return shlex.join(words)
