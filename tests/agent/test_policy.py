"""Policies: found by name, entry point, module or file; and one line, with file and line number, for what goes wrong."""

import re
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policy import PolicyError, files_of, find_policy, policy_file, policy_names, registry
from agent.policy.analytic import Analytic
from agent.policy.cruise import Cruise
from agent.policy.model_file import shipped_models
from protocols.mission.document import parse_mission
from rsc_swarm.flight.simulate import simulate
from tests.agent.example_policy import Homing
from tests.agent.own_policy import HOMING, task, written

MISSION = parse_mission({"agents": 6})


def refusal(name: str) -> str:
    with pytest.raises(PolicyError) as caught:
        find_policy(name, MISSION)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def install(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    """As if a package with this entry point were installed."""
    points = [EntryPoint(name, value, registry.ENTRY_POINTS)]
    monkeypatch.setattr(
        registry, "entry_points", lambda group: points if group == registry.ENTRY_POINTS else []
    )
    monkeypatch.setattr(registry, "_elsewhere", registry._elsewhere.__wrapped__)


def test_built_in_policies_are_known_by_name() -> None:
    assert {"analytic", "cruise", "saber"} <= set(policy_names())
    assert isinstance(find_policy("analytic", MISSION), Analytic)
    assert isinstance(find_policy("cruise", MISSION), Cruise)


def test_a_policy_is_found_by_its_address() -> None:
    policy = find_policy("tests.agent.example_policy:Homing", MISSION)
    assert isinstance(policy, Homing)
    assert policy.limit == 10.0, "it was made for the mission"


def test_an_installed_policy_is_found_by_its_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "homing", "tests.agent.example_policy:Homing")
    assert "homing" in policy_names()
    assert isinstance(find_policy("homing", MISSION), Homing)


def test_an_unknown_policy_is_refused_with_those_that_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, "homing", "tests.agent.example_policy:Homing")
    known = ", ".join(sorted(["analytic", "cruise", "saber", "homing", *shipped_models()]))
    assert refusal("anlytic") == (
        f"policy: unknown policy 'anlytic'; known: {known}; or give FILE.py:Class, package.module:Class or a model file"
    )


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("no.such.module:Class", "cannot be loaded (No module named 'no')"),
        (
            "tests.agent.example_policy:Nobody",
            "there is no Nobody in tests.agent.example_policy; it has Homing, ",
        ),
        ("tests.agent.example_policy:Mute", "has no method act(seen)"),
        ("tests.agent.example_policy:np", "is a module; name a class with a method act(seen)"),
        ("tests.agent.example_policy:Choosy", "raised ValueError: made for 9 agents, not 6 at tests/agent/"),
    ],
)
def test_a_policy_that_cannot_be_had_says_why(name: str, why: str) -> None:
    text = refusal(name)
    assert text.startswith(f"policy {name}: " if not why.startswith("raised") else f"policy {name} ")
    assert why in text


@pytest.mark.parametrize(
    ("files", "line"),
    [
        ("['nowhere.csv']", "files: there is no file nowhere.csv"),
        ("3", "files must be paths of files, not 3"),
        ("[None]", "files must be paths of files, not [None]"),
    ],
)
def test_files_that_are_none_are_refused(tmp_path: Path, files: str, line: str) -> None:
    name = written(tmp_path, f"{HOMING}\n    files = {files}\n")
    assert refusal(name) == f"policy {name}: {line}"


def test_a_policy_is_loaded_from_its_file_wherever_one_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absolute = written(tmp_path, HOMING)
    monkeypatch.chdir(tmp_path)
    assert type(find_policy("homing.py:Homing", MISSION)) is type(find_policy(absolute, MISSION))
    assert not (tmp_path / "__pycache__").exists(), "nothing is written beside it"


def test_what_is_in_the_file_now_is_what_flies(tmp_path: Path) -> None:
    first = find_policy(written(tmp_path, HOMING), MISSION)
    second = find_policy(written(tmp_path, HOMING.replace("+ 0.0", "+ 1.0")), MISSION)
    seen: Any = SimpleNamespace(slot_error=np.zeros((6, 2)))
    assert (first.act(seen).max(), second.act(seen).max()) == (0.0, 1.0)


def test_a_policy_may_use_what_lies_beside_it(tmp_path: Path) -> None:
    (tmp_path / "my_gains.py").write_text("GAIN = 2.0\n")
    (tmp_path / "unused.py").write_text("")
    policy = find_policy(written(tmp_path, "from my_gains import GAIN\n" + HOMING), MISSION)
    assert files_of(policy) == (tmp_path / "homing.py", tmp_path / "my_gains.py")


@pytest.mark.parametrize("statement", [
    "from my_gains import GAIN",
    "import my_gains; GAIN = my_gains.GAIN",
    "import my_gains as m; GAIN = m.GAIN",
    "from .my_gains import GAIN",
    "from more.gains import GAIN",
    "import more.gains; GAIN = more.gains.GAIN",
    "from more import gains; GAIN = gains.GAIN",
    "from whole import GAIN",
])  # fmt: skip
@pytest.mark.parametrize("lazily", [False, True])
def test_what_lies_beside_it_is_imported_in_any_way_at_any_time(
    tmp_path: Path, statement: str, lazily: bool
) -> None:
    for file in ("my_gains.py", "more/gains.py", "whole/inner.py"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("GAIN = 2.0\n")
    (tmp_path / "whole" / "__init__.py").write_text("from .inner import GAIN\n")
    act = HOMING.replace("+ 0.0", "+ GAIN")
    text = act.replace("return", f"{statement}\n        return") if lazily else f"{statement}\n{act}"
    policy = find_policy(written(tmp_path, text), MISSION)
    files = files_of(policy)
    for file in files[1:]:
        file.unlink()  # what flies was read when it was loaded
    seen: Any = SimpleNamespace(slot_error=np.zeros((6, 2)))
    assert policy.act(seen).max() == 2.0
    expected = re.search(r"my_gains|more|whole", statement).group()  # type: ignore[union-attr]
    assert len(files) == (3 if expected == "whole" else 2)
    assert all(expected in str(file) for file in files[1:])
    assert not any(name in sys.modules for name in ("my_gains", "more", "whole"))


def test_an_installed_module_goes_before_one_beside_the_policy(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("1 / 0\n")
    policy = find_policy(written(tmp_path, "import json\n" + HOMING), MISSION)
    assert files_of(policy) == (tmp_path / "homing.py",)


def test_a_held_policy_stays_whatever_becomes_of_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a launch: who is restarted flies what all others fly."""
    name = written(tmp_path, HOMING)
    first = find_policy(name, MISSION)
    monkeypatch.setattr(policy_file, "_held", True)
    written(tmp_path, HOMING.replace("+ 0.0", "+ 1.0"))
    assert type(find_policy(name, MISSION)) is type(first)


def test_what_lies_beside_it_is_its_own(tmp_path: Path) -> None:
    """Two policies may each have a module of the same name beside them, and it may be edited."""
    text = "from my_gains import GAIN\n" + HOMING.replace("+ 0.0", "+ GAIN")
    seen: Any = SimpleNamespace(slot_error=np.zeros((6, 2)))

    def flown(name: str, gain: float) -> float:
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / "my_gains.py").write_text(f"GAIN = {gain}\n")
        return float(find_policy(written(tmp_path / name, text), MISSION).act(seen).max())

    assert [flown("a", 1.0), flown("b", 2.0), flown("a", 3.25), flown("b", 2.0)] == [1.0, 2.0, 3.25, 2.0]
    assert str(tmp_path / "a") not in sys.path


def test_a_file_may_have_the_name_of_a_package_of_ours(tmp_path: Path) -> None:
    import agent

    find_policy(written(tmp_path, HOMING, "agent.py"), MISSION)
    assert sys.modules["agent"] is agent


def test_shipped_policies_are_files_only_where_they_are_models() -> None:
    assert files_of(find_policy("analytic", MISSION)) == ()
    assert [path.name for path in files_of(find_policy("rsc-h20", MISSION))] == [
        "rsc-h20.onnx",
        "rsc-h20.json",
    ]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("class Homing:\n    def act(self seen)\n", "SyntaxError: invalid syntax"),
        ("import nowhere_at_all\n", "ModuleNotFoundError: No module named 'nowhere_at_all' at {file}:1"),
        (HOMING.replace("pass", "import sys; sys.exit(2)"), "SystemExit: 2 at {file}:4 (__init__)"),
        ("raise BaseException\n", "BaseException at {file}:1"),
        (
            "def Homing(): pass\n",
            "TypeError: Homing() takes 0 positional arguments but 1 was given at {file}:1 (Homing)",
        ),
        ("class Homing: pass\n", "TypeError: Homing() takes no arguments at {file}"),
        ("class Oops(Exception):\n    __str__ = None\nraise Oops\n", "Oops at {file}:3"),
        ("x = 1\ny = 1 / 0\n", "ZeroDivisionError: division by zero at {file}:2"),
        (HOMING.replace("pass", "raise KeyError('oops')"), "KeyError: 'oops' at {file}:4 (__init__)"),
        (
            HOMING.replace("self, mission", "self"),
            "TypeError: Homing.__init__() takes 1 positional argument but 2 were given at {file}:3 (__init__)",
        ),
        (
            "class Homing:\n    def __init__(self, m):\n        int('x' * 999)\n",
            "ValueError: invalid literal",
        ),
    ],
)
def test_a_file_that_raises_is_named_with_its_line(tmp_path: Path, text: str, line: str) -> None:
    name = written(tmp_path, text)
    told = refusal(name)
    assert told.startswith(f"policy {name} raised {line.format(file=tmp_path / 'homing.py')}")
    assert len(told) < 500
    if "SyntaxError" in line:
        assert told.endswith(f" at {tmp_path / 'homing.py'}:2")


def test_what_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        refusal("gone.py:Homing")
        == "policy gone.py:Homing: gone.py cannot be read (No such file or directory)"
    )
    written(tmp_path, HOMING + "class Other: pass\n")
    assert refusal("homing.py:Hommig") == (
        "policy homing.py:Hommig: there is no Hommig in homing.py; it has Homing, Other"
    )
    assert refusal("homing.py") == "policy homing.py: name the class in homing.py; it has Homing, Other"
    assert refusal(":Homing").startswith("policy: unknown policy ':Homing'; known: ")
    (tmp_path / "homing.py").write_bytes(b"x = '\xff'\n")
    assert refusal("homing.py:Homing").startswith("policy homing.py:Homing raised SyntaxError: ")


@pytest.mark.parametrize("policy", ["analytic", "cruise", "saber", "tests.agent.example_policy:Homing"])
def test_a_swarm_flies_a_whole_flight_by_any_of_them(policy: str) -> None:
    outcome = simulate([task(policy)])[0]
    assert outcome.success, outcome


def test_a_users_policy_decides_the_flight() -> None:
    assert (
        simulate([task("cruise")])[0].digest
        != simulate([task("tests.agent.example_policy:Homing")])[0].digest
    )
