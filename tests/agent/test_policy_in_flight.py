"""What a policy may do in flight, and the one line, with file and line number, when it goes wrong."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from agent.policy import PolicyError
from rsc_swarm.flight.simulate import simulate
from tests.agent.own_policy import HOMING, task, written

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
