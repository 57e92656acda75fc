"""The documents say what is so: fields, defaults, missions, options, links and examples."""

import re
import shlex
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import BaseModel
from typer.main import get_command

import rsc_swarm as rs
from protocols.mission.document import Mission, parse_mission
from protocols.mission.fault import Fault
from rsc_swarm.cli.commands import loaded
from rsc_swarm.missions import shipped_missions
from rsc_swarm.study.tables.markdown import page
from rsc_swarm.study.tables.result import read_tables
from world.outlets.trajectory import Trajectory

ROOT = Path(__file__).parents[1]
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *(path for folder in ("docs", "deploy", "examples") for path in sorted((ROOT / folder).glob("*.md"))),
]
COMMANDS: dict[str, Any] = get_command(loaded()).commands  # type: ignore[attr-defined]

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
    code = re.findall(r"```(?:sh|yaml)\n(.*?)```", text, re.DOTALL) + re.findall(r"`([^`\n]+)`", text)
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
        command = COMMANDS[name]
        for word in words[1:2]:  # of a group, the command in it
            command = getattr(command, "commands", {}).get(word, command)
        known = {option for parameter in command.params for option in parameter.opts} | {"--help"}
        unknown = [word for word in words if word.startswith("--") and word not in known]
        assert not unknown, (words, unknown)
        if "--mission" in words:
            mission = words[words.index("--mission") + 1]
            assert mission in shipped_missions() or mission.endswith(".yaml"), words


@every_document
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", document.read_text()):
        assert target.startswith("https://") or (document.parent / target).is_file(), target


@every_document
def test_what_is_named_is_there(document: Path) -> None:
    tops = "tests|agent|world|protocols|rsc_swarm|deploy|docs|examples"
    for name in re.findall(rf"`((?:{tops})/[\w/.-]*)`", document.read_text()):
        assert (ROOT / name).exists(), name


def test_a_newcomer_finds_ten_answers() -> None:
    answers = [answer for _, answer in rows(ROOT / "CONTRIBUTING.md", "Ten questions")]
    assert len(answers) == 10
    for answer in answers:
        assert re.findall(r"`([\w/]+\.py)`", answer), answer


def test_every_name_of_the_public_door_is_told() -> None:
    table = (ROOT / "docs" / "api.md").read_text().split("| --- | --- |\n")[1]
    told = [
        re.match(r"\w+", name).group()
        for line in table.splitlines()
        for name in re.findall(r"`([A-Za-z]\w*)[`(]", line)
    ]  # type: ignore[union-attr]
    assert set(rs.__all__) <= set(told)
    first = {re.match(r"\| `(\w+)", line).group(1) for line in table.split("\n\n")[0].splitlines()}  # type: ignore[union-attr]
    assert first <= set(rs.__all__)


def test_every_array_of_a_recorded_flight_is_told() -> None:
    text = (ROOT / "docs" / "recordings.md").read_text()
    told = re.findall(r"^\| `(\w+)` \| (.+?) \| (\w+) \|", text, re.MULTILINE)
    assert [name for name, _, _ in told] == [field.name for field in fields(Trajectory)]
    flown = rs.simulate(rs.mission(agents=3, fly_s=0.1)).trajectory
    sizes = {"T": 11, "N": 3, "M": len(flown.obstacles)}
    for name, shape, kind in told:
        array = np.asarray(getattr(flown, name))
        assert array.dtype.name == kind, name
        if shape.startswith("("):
            assert array.shape == tuple(
                sizes.get(size) or int(size) for size in shape.strip("()").split(", ")
            ), name


def settings(command: str) -> dict[str, str]:
    """What ``rsc-swarm evaluate ...`` flies, defaults included."""
    words = shlex.split(command.strip("`"))[2:]
    given = {"--agents": "25", "--policy": "rsc-h20", "--maps": "200", "--starts": "3", "--seed-base": "0"}
    return given | dict(zip(words[::2], words[1::2], strict=True))


def test_the_figures_are_those_of_the_committed_tables() -> None:
    flown = [row for table in read_tables(ROOT / "docs" / "results") for row in table.rows]
    told = rows(ROOT / "docs" / "performance.md", "How well it flies")
    assert len(told) > 10
    for _, success, collisions, others, tau, runs, command in told:
        (row, *_) = [row for row in flown if settings(row.command) == settings(command)]
        low, high = row.success_interval
        assert success == f"{100 * row.success_rate:.1f} ({100 * low:.1f} to {100 * high:.1f})", command
        assert (collisions, others) == (
            f"{100 * row.collision_rate:.1f}",
            f"{100 * row.noncollision_rate:.1f}",
        ), command
        assert (tau, runs) == (f"{row.tau_mean_s:.2f}", str(row.runs)), command


def test_the_five_figures_are_among_all_figures() -> None:
    page = ROOT / "docs" / "performance.md"
    told = rows(page, "How well it flies") + rows(page, "How fast it runs")
    five = rows(ROOT / "README.md", "Five figures")
    assert len(five) == 5
    for what, figure, command in five:
        number = figure.replace(" %", "")
        assert any(row[-1] == command and any(cell.startswith(number) for cell in row) for row in told), what


def test_the_results_are_those_of_the_committed_tables() -> None:
    results = ROOT / "docs" / "results"
    assert (ROOT / "docs" / "results.md").read_text() == page(read_tables(results))


def test_the_ready_workflows_are_yaml() -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "ci.md").read_text(), re.DOTALL)
    workflow, pipeline = (yaml.safe_load(block) for block in blocks)
    assert [list(step) for step in workflow["jobs"]["fly"]["steps"]]
    assert pipeline["fly"]["script"]
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    wheel = f"vendor/rsc_swarm-{version}-py3-none-any.whl"
    assert workflow["jobs"]["fly"]["env"]["RSC_SWARM"] == pipeline["fly"]["variables"]["RSC_SWARM"] == wheel


@every_document
def test_no_address_stands_in_for_another(document: Path) -> None:
    assert "example.org" not in document.read_text()
    assert "example.com" not in document.read_text()


def test_the_example_mission_can_be_flown() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert parse_mission(yaml.safe_load(example)).agents == 5
