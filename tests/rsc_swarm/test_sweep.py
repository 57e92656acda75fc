"""Degradation curves: the right points, a table beside a picture, and nothing lost when it is stopped."""

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from protocols.mission.document import Mission, MissionError
from rsc_swarm.cli import main as cli
from rsc_swarm.options import MissionOptions
from rsc_swarm.show.plots.sweep import draw
from rsc_swarm.study.sweep import parse_axis, prepare
from rsc_swarm.study.workers import Flight, Seeds


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", "sweep", *words])
    with pytest.raises(SystemExit) as left:
        cli.main()
    return int(left.value.code or 0)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("radio.burst.loss=0:0.9:0.3", (0.0, 0.3, 0.6, 0.9)),
        ("radio.loss=0:0.25:0.1", (0.0, 0.1, 0.2)),
        ("agents=4:16:4", (4, 8, 12, 16)),
        ("radio.frame_rate_hz=5,10,25,100", (5, 10, 25, 100)),
        ("swap.rule=tree,contact", ("tree", "contact")),
        ("detour=true,false", (True, False)),
    ],
)
def test_an_axis_is_read(text: str, values: tuple[object, ...]) -> None:
    axis = parse_axis(text)
    assert axis.values == values
    assert [type(value) for value in axis.values] == [type(value) for value in values]


def test_the_points_are_a_grid_with_the_last_axis_fastest() -> None:
    jobs = prepare(
        MissionOptions(agents=9, set=["hold_s=1"]),
        [parse_axis("radio.loss=0:0.1:0.1"), parse_axis("detour=true,false")],
    )
    assert [(job.mission.radio.loss, job.mission.detour) for job in jobs] == [
        (0, True),
        (0, False),
        (0.1, True),
        (0.1, False),
    ]
    assert {(job.mission.agents, job.mission.hold_s) for job in jobs} == {(9, 1.0)}


def test_a_value_reaches_the_mission_as_it_was_read() -> None:
    jobs = prepare(MissionOptions(), [parse_axis("fly_s=null,2")])
    assert [job.mission.fly_s for job in jobs] == [None, 2.0]


@pytest.mark.parametrize(
    ("axes", "complaint"),
    [
        (["radio.loss"], "--over radio.loss: write FIELD=FIRST:LAST:STEP or FIELD=VALUE,VALUE"),
        (["radio.loss=a:b:c"], "--over radio.loss=a:b:c: write FIELD="),
        (["radio.loss=0:1:0"], "give a first value, a last one that is no smaller, and a step above 0"),
        (["radio.loss=1:0:0.1"], "give a first value"),
        (["radio.loss=0,2"], "--set radio.loss: input should be less than or equal to 1"),
        (["radio.lost=0,1"], "radio.lost"),
        (["radio.loss=0,1", "radio.loss=0"], "--over: names a field twice"),
        (["map_seed=0:900:1", "seed=0,1"], "--over: 1802 points; give at most 1000"),
    ],
)
def test_a_wrong_axis_is_one_line(axes: list[str], complaint: str) -> None:
    with pytest.raises(MissionError) as told:
        prepare(MissionOptions(), [parse_axis(text) for text in axes])
    assert complaint in str(told.value)


def test_a_sweep_leaves_a_table_and_a_picture_and_flies_nothing_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    words = [
        "--agents", "4", "--policy", "analytic", "--set", "fly_s=0.3", "--over", "radio.loss=0:0.5:0.5",
        "--over", "swap.rule=tree,contact", "--maps", "2", "--workers", "1", "--out", str(tmp_path),
    ]  # fmt: skip
    assert run(monkeypatch, *words) == 0
    said = capsys.readouterr().out
    table = list(csv.DictReader((tmp_path / "sweep.csv").open()))
    assert [(row["radio.loss"], row["swap.rule"], row["runs"], row["success"]) for row in table] == [
        (loss, rule, "2", "0.0") for loss in ("0.0", "0.5") for rule in ("tree", "contact")
    ]
    assert len(said.splitlines()) == 6
    assert [point["at"] for point in json.loads((tmp_path / "sweep.json").read_text())][-1] == {
        "radio.loss": 0.5, "swap.rule": "contact",
    }  # fmt: skip
    assert (tmp_path / "sweep.svg").stat().st_size > 1000

    def fly_none(mission: Mission, seeds: list[Seeds], *_: object) -> Iterator[Flight]:
        assert not seeds
        yield from ()

    monkeypatch.setattr("rsc_swarm.study.evaluate.fly_all", fly_none)
    assert run(monkeypatch, *words) == 0, "nothing is missing"
    assert capsys.readouterr().out == said


def test_words_are_drawn_side_by_side(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    row = {"runs": 9, "success": 0.5, "low": 0.3, "high": 0.7}
    draw(["swap.rule"], [{"swap.rule": rule, **row} for rule in ("off", "tree")], tmp_path / "a.svg")
    assert "tree" in (tmp_path / "a.svg").read_text()
