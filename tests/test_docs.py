"""The documents say what is so: fields, defaults, missions, options, links and examples."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import BaseModel
from typer.main import get_command

from protocols.mission.document import Fault, Mission, parse_mission
from rsc_swarm.cli.main import app
from rsc_swarm.cli.options import shipped_missions
from rsc_swarm.study.tables.markdown import page
from rsc_swarm.study.tables.result import read_tables

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "deploy" / "README.md"]
COMMANDS: dict[str, Any] = get_command(app).commands  # type: ignore[attr-defined]

every_document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def rows(document: Path, heading: str) -> list[list[str]]:
    """The cells of the first table under a heading."""
    section = document.read_text().split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


def leaves(model: BaseModel, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every field of a mission by its dotted name, with its value."""
    plain = model.model_dump(mode="json")
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, BaseModel):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield prefix + name, plain[name]


def test_every_field_of_a_mission_is_told_with_its_default() -> None:
    told = {
        name.strip("`"): yaml.safe_load(default.strip("`"))
        for name, default, _ in rows(ROOT / "docs" / "missions.md", "Fields")
    }
    assert told == dict(leaves(Mission()))


def test_every_kind_of_fault_is_told() -> None:
    told = [row[0].strip("`") for row in rows(ROOT / "docs" / "missions.md", "Faults")]
    assert sorted(told) == sorted(Fault.model_fields["kind"].annotation.__args__)  # type: ignore[union-attr]


def test_every_shipped_mission_is_told() -> None:
    heading = "Missions that come with the project"
    told = [row[0].strip("`") for row in rows(ROOT / "docs" / "missions.md", heading)]
    assert sorted(told) == shipped_missions()


def commands(text: str) -> Iterator[list[str]]:
    """The words after every ``rsc-swarm`` that stands in code and is followed by a command."""
    code = re.findall(r"```sh\n(.*?)```", text, re.DOTALL) + re.findall(r"`([^`\n]+)`", text)
    for piece in code:
        for line in piece.replace("\\\n", " ").splitlines():
            for call in re.findall(r"(?:^|[ /])rsc-swarm +((?:[a-z]+ )?[^|>;&\n]*)", line):
                words = shlex.split(call, comments=True)
                if words and (words[0].isalpha() or words[0].startswith("--")):
                    yield words


@every_document
def test_commands_have_the_options_they_are_shown_with(document: Path) -> None:
    for words in commands(document.read_text()):
        name = words[0]
        if name.startswith(("-", "$")):
            continue
        assert name in COMMANDS, words
        known = {option for parameter in COMMANDS[name].params for option in parameter.opts} | {"--help"}
        unknown = [word for word in words if word.startswith("--") and word not in known]
        assert not unknown, (words, unknown)
        if "--mission" in words:
            mission = words[words.index("--mission") + 1]
            assert mission in shipped_missions() or mission.endswith(".yaml"), words


@every_document
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
        assert (document.parent / target).is_file(), target


@every_document
def test_files_that_are_named_are_there(document: Path) -> None:
    for name in re.findall(
        r"`((?:tests|agent|world|protocols|rsc_swarm|deploy)/[\w/]+\.\w+)`", document.read_text()
    ):
        assert (ROOT / name).is_file(), name


def test_the_results_are_those_of_the_committed_tables() -> None:
    results = ROOT / "docs" / "results"
    assert (ROOT / "docs" / "results.md").read_text() == page(read_tables(results))


def test_the_example_mission_can_be_flown() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert parse_mission(yaml.safe_load(example)).agents == 5
