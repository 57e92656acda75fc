"""Policies: found by name, entry point, module or file; and one line, with file and line number, for what goes wrong."""

import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policy import PolicyError, files_of, find_policy, policy_names, registry
from agent.policy.analytic import Analytic
from agent.policy.cruise import Cruise
from agent.policy.model_file import shipped_models
from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import Simulation, simulate
from tests.agent.example_policy import Homing

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
        ("tests.agent.example_policy:Choosy", "raised ValueError: made for 9 agents, not 6 at tests/agent/"),
    ],
)
def test_a_policy_that_cannot_be_had_says_why(name: str, why: str) -> None:
    text = refusal(name)
    assert text.startswith(f"policy {name}: " if not why.startswith("raised") else f"policy {name} ")
    assert why in text


HOMING = """
class Homing:
    def __init__(self, mission):
        pass

    def act(self, seen):
        return seen.slot_error + 0.0
"""


def written(folder: Path, text: str, name: str = "homing.py") -> str:
    """The name of the policy ``Homing`` in a file with this text."""
    (folder / name).write_text(text)
    return f"{folder / name}:Homing"


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
        ("x = 1\ny = 1 / 0\n", "ZeroDivisionError: division by zero at {file}:2"),
        (HOMING.replace("pass", "raise KeyError('oops')"), "KeyError: 'oops' at {file}:4 (__init__)"),
        (
            HOMING.replace("self, mission", "self"),
            "TypeError: Homing.__init__() takes 1 positional argument but 2 were given",
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


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("return {}['oops']", "policy {name} raised KeyError: 'oops' at {file}:7 (act)"),
        (
            "return np.zeros(3) @ np.zeros(2)",
            "policy {name} raised NameError: name 'np' is not defined at {file}:7 (act)",
        ),
        ("return seen.slot_error.tolist()", "policy {name}: act must return (6, 2) float64, not list"),
        ("return seen.slot_error[:1]", "policy {name}: act must return (6, 2) float64, not (1, 2) float64"),
        (
            "return seen.slot_error.astype('f4')",
            "policy {name}: act must return (6, 2) float64, not (6, 2) float32",
        ),
        ("return None", "policy {name}: act must return (6, 2) float64, not NoneType"),
    ],
)
def test_a_policy_that_goes_wrong_in_flight_is_named(tmp_path: Path, body: str, line: str) -> None:
    name = written(tmp_path, HOMING.replace("return seen.slot_error + 0.0", body))
    with pytest.raises(PolicyError) as caught:
        simulate([task(name, fly_s=0.1)])
    assert str(caught.value) == line.format(name=name, file=tmp_path / "homing.py")


def test_the_line_is_one_of_the_policys_own_even_if_a_library_raised(tmp_path: Path) -> None:
    text = "import json\n" + HOMING.replace("return seen.slot_error + 0.0", "return json.loads('{')")
    with pytest.raises(PolicyError, match=r"raised JSONDecodeError: .* at .*homing\.py:8 \(act\)$"):
        simulate([task(written(tmp_path, text), fly_s=0.1)])


@pytest.mark.parametrize("method", ["open", "forget"])
def test_its_other_methods_are_named_too(tmp_path: Path, method: str) -> None:
    name = written(
        tmp_path, HOMING + f"\n    def {method}(self, *row):\n        raise OSError('no camera')\n"
    )
    fault = {"at_s": 0.02, "kind": "restart", "agents": [2]}
    with pytest.raises(PolicyError, match=rf"raised OSError: no camera at .*homing\.py:10 \({method}\)$"):
        simulate([task(name, fly_s=0.1, faults=[fault])])


def test_what_a_policy_returns_is_its_own(tmp_path: Path) -> None:
    """It may return what it was shown, or a view nobody can write to: neither changes what is seen or is compiled anew."""
    plain = simulate([task(written(tmp_path, HOMING))])[0]
    shown = simulate([task(written(tmp_path, HOMING.replace(" + 0.0", "")))])[0]
    columns = HOMING.replace("return seen.slot_error + 0.0", "return seen.slot_error.T.copy().T")
    assert plain.digest == shown.digest == simulate([task(written(tmp_path, columns))])[0].digest


def task(policy: str, **fields: Any) -> Mission:
    return parse_mission({"agents": 6, "policy": policy, "obstacles": {"discs": []}, **fields})


@pytest.mark.parametrize("policy", ["analytic", "cruise", "saber", "tests.agent.example_policy:Homing"])
def test_a_swarm_flies_a_whole_flight_by_any_of_them(policy: str) -> None:
    outcome = simulate([task(policy)])[0]
    assert outcome.success, outcome


def test_a_users_policy_decides_the_flight() -> None:
    assert (
        simulate([task("cruise")])[0].digest
        != simulate([task("tests.agent.example_policy:Homing")])[0].digest
    )


@pytest.mark.parametrize("filtered", [True, False])
def test_a_policy_that_wants_nonsense_is_not_followed(filtered: bool) -> None:
    # Far apart, so that the safety filter has nothing to say.
    fields = {"start": {"radius_m": 0}, "safety_filter": filtered, "fly_s": 0.3}
    simulation = Simulation([task("tests.agent.example_policy:Nonsense", **fields)])
    start = simulation.world.position.copy()
    while simulation.world.active.any():
        simulation.tick()
    assert np.array_equal(simulation.world.position, start)
