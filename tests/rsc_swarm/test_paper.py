"""docs/paper.md names code that is there, and mission ``paper`` is what it says."""

import ast
import re
from pathlib import Path

import pytest

from protocols.mission.document import Mission
from rsc_swarm.options import MissionOptions, resolve

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text()
NAMED = sorted(set(re.findall(r"`([\w/]+\.py):(\w+)`", PAGE)))


def test_the_page_names_code_for_every_part_of_the_paper() -> None:
    assert len(NAMED) > 30
    parts = re.split(r"^## ", PAGE, flags=re.MULTILINE)[2:]
    assert all(re.search(r"`[\w/]+\.py:\w+`", part) for part in parts)


@pytest.mark.parametrize(("file", "name"), NAMED)
def test_what_it_names_is_there(file: str, name: str) -> None:
    tree = ast.parse((ROOT / file).read_text())
    defined = {node.name for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    assert name in defined


def test_every_setting_of_the_mission_is_on_the_page() -> None:
    """Nothing but what is listed differs from the defaults."""
    papers, plain = (
        mission.model_dump() for mission in (resolve(MissionOptions(mission="paper")), Mission())
    )
    table = PAGE.split("## Section")[0]
    for field, value in papers.items():
        if field == "name":
            continue
        inner = value.items() if isinstance(value, dict) else ()
        differing = [name for name, one in inner if one != plain[field][name]]
        if value != plain[field]:
            for name in differing or [field]:
                assert name in table, f"{field}: {name}"
