"""Policies: found by name, entry point, module or file; and one line, with file and line number, for what goes wrong."""

import re
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
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
from protocols.mission.document import Mission, parse_mission
from rsc_swarm.flight.simulate import simulate
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


SHAPE = "policy {name}: act must return (6, 2) float64, not "
WISH = "policy {name}: act wants (X) m/s² of agent 0; give finite numbers of at most 1e+06{place}"


@pytest.mark.parametrize(
    ("body", "line"),
    [
        ("return {}['oops']", "policy {name} raised KeyError: 'oops' at {file}:8 (act)"),
        ("return wings(seen)", "policy {name} raised NameError: name 'wings' is not defined at {file}:8 (act)"),
        ("raise KeyboardInterrupt", "policy {name} raised KeyboardInterrupt at {file}:8 (act)"),
        ("raise BaseException('all')", "policy {name} raised BaseException: all at {file}:8 (act)"),
        ("sys.exit(3)", "policy {name} raised SystemExit: 3 at {file}:8 (act)"),
        ("self.act(seen)", "policy {name} raised RecursionError: maximum recursion depth exceeded... at {file}:8 (act)"),
        ("seen.position[0] = 0", "policy {name} raised ValueError: assignment destination is read-only at {file}:8 (act)"),
        ("seen.memory.near_rel += 1", "policy {name} raised ValueError: output array is read-only at {file}:8 (act)"),
        ("seen.height", "policy {name} raised AttributeError: Seen has no 'height'; it has tick, me, ... at {file}:8 (act)"),
        ("return seen.slot_error.tolist()", SHAPE + "list{place}"),
        ("return seen.slot_error[:1]", SHAPE + "(1, 2) float64{place}"),
        ("return seen.slot_error.astype('f4')", SHAPE + "(6, 2) float32{place}"),
        ("return seen.slot_error * 1j", SHAPE + "(6, 2) complex128{place}"),
        ("return seen.slot_error.astype('U3')", SHAPE + "(6, 2) <U3{place}"),
        ("return seen.slot_error.astype(object)", SHAPE + "(6, 2) object{place}"),
        ("return seen.slot_error.astype('>f8')", SHAPE + "(6, 2) >f8{place}"),
        ("return None", SHAPE + "NoneType{place}"),
        ("yield None", SHAPE + "generator{place}"),
        ("return 'north'", SHAPE + "str{place}"),
        ("return pathlib.Path()", SHAPE + "pathlib.PosixPath{place}"),
        ("return np.full((6, 2), np.nan)", WISH.replace("X", "nan, nan")),
        ("return np.array([[1, -np.inf]] * 6)", WISH.replace("X", "1, -inf")),
        ("return np.full((6, 2), 1.7e308)", WISH.replace("X", "1.7e+308, 1.7e+308")),
    ],
)  # fmt: skip
def test_a_policy_that_goes_wrong_in_flight_is_named(tmp_path: Path, body: str, line: str) -> None:
    text = "import sys, pathlib\nimport numpy as np" + HOMING.replace("return seen.slot_error + 0.0", body)
    name = written(tmp_path, text)
    with ctrl_c_is_answered(), pytest.raises(PolicyError) as caught:
        simulate([task(name, fly_s=0.1)])
    file = tmp_path / "homing.py"
    line = line.replace("{name}", name).replace("{place}", " at {file}:7 (act)").replace("{file}", str(file))
    start, _, end = line.partition("...")
    told = str(caught.value)
    assert told.startswith(start)
    assert told.endswith(end or line)
    assert "\n" not in told


@contextmanager
def ctrl_c_is_answered() -> Iterator[None]:
    """As in every flight: only then is a KeyboardInterrupt the policy's own."""
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(
    ("act", "line"),
    [
        ("def act(self)", "act() takes 1 positional argument but 2 were given at {file}:6 (act)"),
        (
            "def act(self, seen, more)",
            "act() missing 1 required positional argument: 'more' at {file}:6 (act)",
        ),
    ],
)
def test_an_act_that_takes_something_else_is_named(tmp_path: Path, act: str, line: str) -> None:
    name = written(tmp_path, HOMING.replace("def act(self, seen)", act))
    with pytest.raises(PolicyError) as caught:
        simulate([task(name, fly_s=0.1)])
    assert str(caught.value).startswith(f"policy {name} raised TypeError: Homing.")
    assert str(caught.value).endswith(line.format(file=tmp_path / "homing.py"))


def test_what_a_policy_keeps_stays_as_it_was(tmp_path: Path) -> None:
    """It need not copy what it wants to remember."""
    text = HOMING.replace(
        "return seen.slot_error + 0.0",
        """if seen.tick:
            assert not np.array_equal(seen.position, self.position)
            assert np.array_equal(self.position, self.copy)
            assert np.array_equal(self.memory.near_rel, self.near)
        self.position, self.memory = seen.position, seen.memory
        self.copy, self.near = seen.position.copy(), seen.memory.near_rel.copy()
        return seen.slot_error""",
    )
    assert simulate([task(written(tmp_path, "import numpy as np" + text), fly_s=0.2)])[0].ticks == 20


def test_what_a_policy_did_not_look_at_in_time_is_gone(tmp_path: Path) -> None:
    text = HOMING.replace("pass", "self.last = None").replace(
        "return", "last, self.last = self.last, seen\n        last and last.position\n        return"
    )
    with pytest.raises(
        PolicyError, match=r"seen\.position of tick 0 is gone; look at it while act runs.* at .*:8"
    ):
        simulate([task(written(tmp_path, text), fly_s=0.1)])


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
