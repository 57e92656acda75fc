"""The paper's tables: every row can be flown, nothing is flown twice, and the paper's figures stand beside ours."""

import csv
import os
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from protocols.mission.document import Mission, MissionError
from rsc_swarm.cli import tables as command
from rsc_swarm.options import MissionOptions, resolve
from rsc_swarm.study.evaluate import Amount, seeds_of
from rsc_swarm.study.machines import Who
from rsc_swarm.study.tables import flying, plan_error, rows
from rsc_swarm.study.tables.markdown import cells, drawn, legend, markdown, page
from rsc_swarm.study.tables.plan_error import accuracy_of
from rsc_swarm.study.tables.result import TableError, as_csv, path_of, read_table, read_tables
from rsc_swarm.study.tables.rows import TABLES
from rsc_swarm.study.tables.table import Paper, Place, Row, Table, Way, chosen
from rsc_swarm.study.tables.verify import sample
from rsc_swarm.study.workers import Flight, WorkerError

HERE = Place("here", "4 drones", MissionOptions(agents=4, set=["fly_s=0.3"]))
PAPER = Paper(83.0, 13.17, 7.9, 2.5)
SMALL = Table(
    "small",
    "A small table",
    "drones",
    (
        Row(HERE, "Analytic", Way("bare", "without filter", ("safety_filter=false",)), "analytic", PAPER),
        Row(HERE, "Cruise", Way("", ""), "cruise"),
    ),
)


@pytest.fixture(autouse=True)
def small_table(monkeypatch):
    monkeypatch.setitem(rows.TABLES, SMALL.name, SMALL)


def evaluate(out: Path, names: str | None = None, maps: int = 2) -> int:
    return command.fly_table(
        SMALL.name, names, out, MissionOptions(), Amount(maps, 1, 1_000_000, Who(1)), None
    )


def test_every_row_is_a_mission_and_has_a_name_of_its_own():
    for table in TABLES.values():
        assert len({row.key for row in table.rows}) == len(table.rows)
        for row in table.rows:
            assert resolve(row.options).policy == row.policy, row.key


def test_the_tables_have_the_papers_rows():
    names = [row.name for row in TABLES["1"].rows if row.paper]
    assert list(dict.fromkeys(names)) == [
        "Expert", "Saber", "STGNN", "RSC-H1", "RSC-H10", "RSC-H20", "RSC-H30", "RSC-H40"
    ]  # fmt: skip
    sizes = [resolve(row.options) for row in TABLES["2"].rows if row.policy == "rsc-h20"]
    assert [mission.agents for mission in sizes[::2]] == [6, 12, 36, 49, 15]
    assert {len(mission.layout) for mission in sizes} == {6, 12, 36, 49, 15}
    assert len([row for row in TABLES["3"].rows if row.way.word == "paper"]) == 4


def test_as_in_the_paper_is_without_what_the_paper_has_not():
    (row,) = chosen(TABLES["3"].rows, "no-blend/no-swaps/paper", "table 3")
    mission = resolve(row.options)
    assert (mission.trajectory.tracking, mission.trajectory.replan_ticks) == ("required", 20)
    assert (mission.trajectory.blend, mission.safety_filter, mission.swap.rule) == (False, False, "off")
    assert row.paper == Paper(38.0, 12.08, 8.75, 36.0)
    (ours,) = chosen(TABLES["1"].rows, "rsc-h20/ours", "table 1")
    assert resolve(ours.options) == Mission(policy="rsc-h20")


def test_all_steps_from_the_letter_make_ours_in_either_order():
    letter, ours = (resolve(row.options) for row in TABLES["letter"].rows[:2])
    assert letter == resolve(MissionOptions(mission="paper", policy="rsc-h20"))
    assert ours.model_copy(update={"name": "plain"}) == Mission(policy="rsc-h20")
    for order in ("onward", "back"):
        last = chosen(TABLES["letter"].rows, order, "table letter")[-1]
        missing = {"onward": "all-but/detour", "back": "all-but/filter"}[order]
        (same,) = chosen(TABLES["letter"].rows, missing, "table letter")
        assert resolve(last.options) == resolve(same.options)


def test_a_table_is_verified_by_flying_some_of_it_again(tmp_path, capsys):
    evaluate(tmp_path, maps=3)
    path = path_of(tmp_path, "small")
    assert command.verify_tables(read_tables(tmp_path), None, 2, Who(1)) == 0
    assert "2 of 2 rows as they stand" in capsys.readouterr().out
    table = read_table(path)
    moved = [
        row.model_copy(update={"failures": {"collision": row.failures["late"]}}) for row in table.rows[:1]
    ]
    elsewhere = [row.model_copy(update={"command": "rsc-swarm evaluate"}) for row in table.rows[1:]]
    path.write_text(table.model_copy(update={"rows": (*moved, *elsewhere)}).model_dump_json())
    assert command.verify_tables(read_tables(tmp_path), None, 2, Who(1)) == 1
    out = capsys.readouterr().out
    assert (
        "table small, here/analytic/bare: map 1000000, seed 1000000000: late now, collision in the table; "
        in out
    )
    assert "table small, here/cruise: is flown by another command now: rsc-swarm evaluate --agents 4" in out
    assert out.endswith("0 of 2 rows as they stand\n")


def test_half_of_what_is_verified_failed_where_so_many_did(tmp_path):
    evaluate(tmp_path, "analytic", maps=10)
    (row,) = read_table(path_of(tmp_path, "small")).rows
    lost = row.failures["late"]
    few = row.model_copy(update={"failures": {"late": lost[:3]}})
    assert [seed in lost[:3] for _, seed in sample(few, 4)] == [True, True, False, False]
    assert len(sample(few, 100)) == len({*sample(few, 100)}) == 10
    assert len(sample(row, 4)) == 4


def test_rows_are_chosen_by_their_words():
    keys = [row.key for row in chosen(TABLES["2"].rows, "n36/ours, n6/expert", "table 2")]
    assert keys == [
        "n6/expert",
        "n6/expert/letter",
        "n36/analytic/ours",
        "n36/rsc-h20/ours",
        "n36/rsc-h30/ours",
        "n36/rsc-h40/ours",
    ]
    assert chosen(SMALL.rows, None, "table small") == list(SMALL.rows)
    with pytest.raises(MissionError, match=r"--rows n7: no such row in table 2; its words are n6, expert, "):
        chosen(TABLES["2"].rows, "n6,n7", "table 2")


def test_a_table_is_written_for_people_and_programs(tmp_path, capsys):
    assert evaluate(tmp_path) == 0
    out = capsys.readouterr().out
    table = read_table(path_of(tmp_path, "small"))
    assert out == markdown(table) == path_of(tmp_path, "small", "md").read_text()
    assert out.splitlines()[0].startswith(
        "| drones | model | flown | runs | S % | paper's S | S strict % | C % | paper's C |"
    )
    assert (
        "| 4 drones | Analytic | without filter | 2 | 0.0 (0.0 to 65.8) | 83.0 | 0.0 (0.0 to 65.8) | 0.0 | 14.5 | 100.0 | 2.5 |"
        in out
    )
    assert "2 runs: maps 1000000 to 1000001, 1 start each." in out
    lines = list(csv.DictReader(path_of(tmp_path, "small", "csv").read_text().splitlines()))
    assert [line["key"] for line in lines] == ["here/analytic/bare", "here/cruise"]
    assert (lines[0]["paper_success_pct"], lines[1]["paper_success_pct"]) == ("83.0", "")
    assert table.rows[0].failures == {"late": [1_000_000_000, 1_000_001_000]}
    assert table.rows[0].command == (
        "rsc-swarm evaluate --agents 4 --policy analytic --set fly_s=0.3 --set safety_filter=false "
        "--maps 2 --starts 1 --seed-base 1000000"
    )
    assert drawn(table) is not None


def test_a_column_without_figures_is_left_out(tmp_path):
    evaluate(tmp_path, "cruise")
    heading = cells(read_table(path_of(tmp_path, "small")))[0]
    assert heading == [
        "drones", "model", "runs", "S %", "S strict %", "C %", "D %", "stood 2 s %", "agreed %", "swaps"
    ]  # fmt: skip


def test_what_a_rule_for_slots_costs_stands_in_its_table_only(tmp_path, monkeypatch, capsys):
    evaluate(tmp_path, "cruise")
    assert "undone" not in capsys.readouterr().out
    monkeypatch.setitem(rows.TABLES, SMALL.name, replace(SMALL, of_slots=True))
    table = read_table(path_of(tmp_path, "small"))
    heading, line = cells(table)
    assert heading[-3:] == ["swaps", "undone", "two in a slot s"]
    assert line[-2:] == ["0.0", "0.01"]
    assert "*highest version*" in legend(table)


def test_the_slots_table_flies_every_rule_where_slots_matter():
    missions = [resolve(row.options) for row in chosen(TABLES["slots"].rows, "form-up/n36", "table slots")]
    assert [(mission.swap.rule, mission.swap.protocol) for mission in missions] == [
        ("contact", "agreed"), ("contact", "highest-version"), ("off", "agreed")
    ]  # fmt: skip
    assert {(mission.name, mission.agents) for mission in missions} == {("form-up", 36)}


def test_a_part_flown_later_joins_the_table(tmp_path, capsys):
    evaluate(tmp_path, "cruise", maps=2)
    evaluate(tmp_path, "analytic", maps=3)
    table = read_table(path_of(tmp_path, "small"))
    assert [(row.name, row.runs) for row in table.rows] == [("Analytic", 3), ("Cruise", 2)]
    assert legend(table).endswith(
        "2 runs: maps 1000000 to 1000001, 1 start each. 3 runs: maps 1000000 to 1000002, 1 start each."
    )
    assert "Cruise" not in capsys.readouterr().out.split("| drones |")[2]


def test_what_was_flown_is_not_flown_again(tmp_path):
    evaluate(tmp_path, "cruise", maps=2)
    jobs = flying.prepare(list(SMALL.rows), seeds_of(1_000_000, 3, 1), tmp_path)
    assert [job.missing for job in jobs] == [3, 1]


def test_a_stopped_table_keeps_its_rows_and_goes_on(tmp_path, monkeypatch, capsys):
    fly_all = flying.evaluate

    def stopped(mission: Mission, *others: object) -> list[Flight]:
        if mission.policy == "cruise":
            raise KeyboardInterrupt
        return fly_all(mission, *others)

    monkeypatch.setattr(flying, "evaluate", stopped)
    assert evaluate(tmp_path) == 130
    assert "stopped after 1 of 2 rows; what was flown is kept" in capsys.readouterr().err
    assert [row.name for row in read_table(path_of(tmp_path, "small")).rows] == ["Analytic"]
    monkeypatch.setattr(flying, "evaluate", fly_all)
    assert evaluate(tmp_path) == 0
    assert len(read_table(path_of(tmp_path, "small")).rows) == 2


def test_a_row_that_cannot_be_flown_is_named_before_any_is_flown(tmp_path, monkeypatch):
    missing = Table("missing", "", "", (*SMALL.rows, Row(HERE, "Nobody", Way("", ""), "nobody")))
    monkeypatch.setitem(rows.TABLES, "missing", missing)
    with pytest.raises(
        MissionError, match=r"row here/nobody cannot be flown: policy: unknown policy 'nobody'"
    ):
        command.fly_table("missing", None, tmp_path, MissionOptions(), Amount(1, 1, 0, Who(1)), None)
    assert list((tmp_path / "flights").iterdir()) == []


def test_what_is_no_table_is_refused_in_one_line(tmp_path):
    with pytest.raises(TableError, match="no table here; rsc-swarm evaluate --table 1"):
        read_tables(tmp_path)
    with pytest.raises(TableError, match="cannot be read"):
        read_table(tmp_path / "table-1.json")
    (tmp_path / "table-small.json").write_text('{"table": "small"}')
    with pytest.raises(TableError, match="is not a table of this version"):
        evaluate(tmp_path)
    path_of(tmp_path, "small").write_text('{"table": "unheard-of", "title": "", "rows": []}')
    with pytest.raises(TableError, match="is not a table of this version"):
        read_tables(tmp_path)


def test_all_tables_make_one_page(tmp_path, capsys):
    evaluate(tmp_path)
    capsys.readouterr()
    command.tables(folder=tmp_path, workers=None, on=None)
    said = capsys.readouterr().out
    assert said == page(read_tables(tmp_path))
    assert "\n## small: A small table\n\n| drones | model |" in said
    assert as_csv(read_tables(tmp_path)[0]).count("\n") == 3


SEEDS = seeds_of(1_000_000, 30, 2)
MODEL = Mission(policy="rsc-h20")


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """Put something in the place of what measures models."""
    (tmp_path / "rsc-h20.onnx").touch()
    monkeypatch.setattr(plan_error, "SHIPPED", tmp_path)

    def put(mae: object) -> Path:
        module = ModuleType("rsc_swarm.study.accuracy")
        module.mae = mae  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, module.__name__, module)
        return tmp_path / "rsc-h20.code.journal.jsonl"

    return put


def test_a_models_foresight_is_measured_once_in_a_process_of_its_own(measured):
    journal = measured(lambda model, mission, maps: (os.getpid(), float(len(maps))))
    accuracy = accuracy_of(MODEL, journal, SEEDS)
    assert accuracy is not None
    assert (accuracy.model_m != os.getpid(), accuracy.constant_velocity_m) == (True, 20)
    assert accuracy_of(MODEL, journal, SEEDS) == accuracy
    assert accuracy_of(Mission(policy="analytic"), journal, SEEDS) is None


@pytest.mark.parametrize(
    ("mae", "complaint"),
    [
        (lambda *_: 1 / 0, "measuring the accuracy of rsc-h20: ZeroDivisionError: division by zero"),
        (lambda *_: os._exit(9), "measuring the accuracy of rsc-h20: the process died"),
    ],
)
def test_a_measurement_that_breaks_is_one_line(measured, mae, complaint):
    with pytest.raises(WorkerError, match=complaint):
        accuracy_of(MODEL, measured(mae), SEEDS)
