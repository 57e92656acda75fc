"""Fleet files from the command line: what can be flown is drawn, what cannot is refused in one line."""

import sys
from pathlib import Path

import pytest

from protocols.fleet.document import FleetError
from rsc_swarm.air.plans import read_plan
from rsc_swarm.cli import main as cli

EXAMPLES = Path(__file__).parents[3] / "examples"


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", *words])
    with pytest.raises(SystemExit) as left:
        cli.main()
    return int(left.value.code or 0)


@pytest.mark.parametrize(
    ("name", "size"), [("room.yaml", (6, 4)), ("hall.yaml", (12, 8)), ("six.yaml", (6, 4))]
)
def test_the_examples_can_be_flown_in_the_rooms_they_are_for(name: str, size: tuple[float, float]) -> None:
    plan = read_plan(EXAMPLES / name)
    fence = plan.fleet.fence
    assert (fence.x_m[1] - fence.x_m[0], fence.y_m[1] - fence.y_m[0]) == size


def test_a_plan_is_drawn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "plan.svg"
    assert (
        run(monkeypatch, "ground", "--fleet", str(EXAMPLES / "room.yaml"), "--check", "--out", str(picture))
        == 0
    )
    assert "can be flown by 6 drones" in capsys.readouterr().out
    assert picture.stat().st_size > 5000


def test_a_mission_beside_the_fleet_file_is_found(tmp_path: Path) -> None:
    shipped = EXAMPLES.parent / "rsc_swarm" / "missions" / "lab-small.yaml"
    (tmp_path / "mine.yaml").write_text(shipped.read_text())
    text = (EXAMPLES / "room.yaml").read_text()
    (tmp_path / "fleet.yaml").write_text(text.replace("mission: lab-small", "mission: mine.yaml"))
    assert (
        read_plan(tmp_path / "fleet.yaml").mission_digest == read_plan(EXAMPLES / "room.yaml").mission_digest
    )
    (tmp_path / "fleet.yaml").write_text(text.replace("mission: lab-small", "mission: yours.yaml"))
    with pytest.raises(
        FleetError, match=r"mission: there is no file .*yours\.yaml; name one, or one that comes"
    ):
        read_plan(tmp_path / "fleet.yaml")


BAD = [
    (("fly", "--agent", "6", "--fleet", "room.yaml"), "--agent 6: the fleet's drones are 0 to 5"),
    (("fly", "--agent", "0", "--fleet", "none.yaml"), "none.yaml: cannot be read"),
    (
        ("fly", "--agent", "0", "--fleet", "room.yaml", "--body", "balloon:"),
        "'balloon:' is no vehicle: write KIND:WHERE",
    ),
    (
        ("fly", "--agent", "0", "--fleet", "room.yaml", "--trouble", "gremlins"),
        "'gremlins' is none; write loss=0.3",
    ),
    (("air", "--fleet", "room.yaml", "--trouble", "loss=0.3"), "write the drone's number first"),
    (("air", "--fleet", "room.yaml", "--trouble", "9:loss=0.3"), "write the drone's number first"),
    (
        ("ground", "--fleet", "room.yaml", "--do", "arm,fly"),
        "'fly' is no step; known: preflight, arm, takeoff",
    ),
    (("ground", "--fleet", "room.yaml", "--do", ""), "--do: nothing; write steps"),
]


@pytest.mark.parametrize(("words", "why"), BAD, ids=[why for _, why in BAD])
def test_what_cannot_be_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], why: str
) -> None:
    monkeypatch.chdir(EXAMPLES)
    assert run(monkeypatch, *words) == 2
    told = capsys.readouterr().err.strip()
    assert why in told
    assert "\n" not in told
