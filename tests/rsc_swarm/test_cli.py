"""The command line: exit codes, one-line errors, what goes to which stream, and a quick start."""

import errno
import json
import os
import pty
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rsc_swarm.flight.launch import RunBroken
from rsc_swarm.flight.report import FlightReport
from rsc_swarm.flight.run_dir import RunDir

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "rsc_swarm.cli.main"]


def test_a_successful_flight_exits_with_0_and_tells_it_on_stdout(run):
    code, out, err = run("simulate", "--agents", "1", "--set", "start.radius_m=0")
    assert code == 0
    assert out.startswith("SUCCESS: the agent beyond the goal line")
    assert out.splitlines()[-1] == "Fly it again:  rsc-swarm simulate --agents 1 --set start.radius_m=0"
    assert err.splitlines()[1].startswith("t   2.00 s")


def test_a_failed_flight_exits_with_1(run):
    code, out, _ = run("simulate", "--agents", "4", "--set", "fly_s=0.3")
    assert code == 1
    assert out.startswith("FAILED (late): not in formation beyond the goal line within 0.30 s")


def test_json_on_stdout_is_nothing_but_json(run):
    code, out, err = run("simulate", "--agents", "4", "--set", "fly_s=0.3", "--json", "-")
    assert code == 1
    assert FlightReport.model_validate_json(out).failure == "late"
    assert "FAILED (late)" in err


def test_a_run_directory_and_a_json_file_tell_the_same(run, tmp_path, monkeypatch):
    flight, file = tmp_path / "flight", tmp_path / "report.json"
    arguments = ("--agents", "4", "--set", "fly_s=0.3", "--json", str(file), "--run-dir", str(flight))
    assert run("simulate", *arguments)[0] == 1
    assert json.loads(file.read_text()) == json.loads((flight / "report.json").read_text())
    assert "policy" not in [path.name for path in flight.iterdir()], "a shipped model is found by its name"
    again = json.loads(file.read_text())["again"]
    assert again == f"rsc-swarm simulate --mission {flight / 'mission.yaml'}"
    monkeypatch.chdir("/")
    code, out, _ = run(*shlex.split(again)[1:])
    assert code == 1
    assert json.loads(file.read_text())["digest"] in out
    code, _, err = run("simulate", *arguments)
    assert (code, err) == (
        2, f"rsc-swarm: --run-dir {flight}: holds a flight already; give a new directory, or --overwrite\n"
    )  # fmt: skip
    assert run("simulate", *arguments, "--overwrite")[0] == 1


def test_a_full_disk_loses_no_more_than_it_must(run, tmp_path, monkeypatch):
    arguments = ("simulate", "--agents", "4", "--set", "fly_s=0.3")
    code, out, err = run(*arguments, "--json", "/dev/full", "--run-dir", str(tmp_path / "flight"))
    assert code == 3
    assert out.startswith("FAILED (late)")
    assert err.splitlines()[-1] == "rsc-swarm: /dev/full: cannot be written (No space left on device)"
    assert (tmp_path / "flight" / "report.json").is_file()
    begun = RunDir.begin

    def fill(*told: object, **more: object) -> None:
        begun(*told, **more)
        monkeypatch.setattr(os, "fsync", full)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(RunDir, "begin", fill)
    code, out, err = run(*arguments, "--run-dir", str(tmp_path / "other"))
    assert code == 3
    assert out.startswith("FAILED (late)")
    line = err.splitlines()[-1]
    assert line.startswith("rsc-swarm: ")
    for name in ("trajectory.npz", "events.jsonl", "report.json"):
        assert f"{tmp_path}/other/{name}: cannot be written (No space left on device)" in line


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("simulate --agents 0", "--agents: input should be greater than or equal to 1, not 0"),
        ("simulate --bogus", "no such option: --bogus"),
        ("simulate --swap foo", "invalid value for '--swap'"),
        ("simulate --policy none", "policy: unknown policy 'none'; known: "),
        (
            "simulate --policy expert",
            "policy expert: sees the whole field and all drones, so no drone can fly it",
        ),
        ("simulate --mission nowhere", "--mission nowhere: no such file; shipped missions are"),
        ("simulate --json /nowhere/x.json", "--json /nowhere/x.json: give a file in a directory that exists"),
        ("simulate --run-dir /proc/flight", "--run-dir /proc/flight: cannot be written"),
        ("evaluate --map 3", "--map and --seed: evaluate chooses the seeds"),
        ("evaluate --table 5", "--table 5: there is none; the tables are 1, 2, 3, harder, letter, slots"),
        ("evaluate --table 1 --agents 6", "--agents: the rows of a table say what is flown"),
        ("evaluate --table 1 --json x.json", "--json: a table writes its JSON into --out"),
        ("evaluate --rows expert", "--rows and --out: are for tables; say which one with --table"),
        ("tables /nowhere", "/nowhere: no table here; rsc-swarm evaluate --table 1 --out /nowhere makes one"),
        ("evaluate --workers 0", "--workers: give at least 1, not 0"),
        (
            "mission --set start.radius_m=0 --set start.gap_m=99",
            "agent 0 finds no free place within start.radius_m",
        ),
        (
            "agent --agent 0 --connect tcp/localhost:1 --credentials /nowhere",
            "invalid value for '--credentials'",
        ),
        ("agent --agent 250 --connect tls/a:1 --credentials pyproject.toml", "invalid value for '--agent'"),
        (
            "agent --agent 0 --connect tcp/10.0.0.1:7447 --credentials pyproject.toml",
            "tcp/10.0.0.1:7447 is plain text, which everybody on the way can read and change: make keys once",
        ),
        (
            "agents 0-11 --connect tcp/localhost:1 --credentials-dir /nowhere",
            "invalid value for '--credentials-dir'",
        ),
        (
            "agents 0-3,2 --connect tcp/localhost:1 --credentials-dir tests",
            "'0-3,2' names drone 2 twice; name each drone once",
        ),
        ("agents 0-3 --connect tcp/10.0.0.1:1 --credentials-dir tests", "tcp/10.0.0.1:1 is plain text"),
        ("world --listen tcp/10.0.0.1:7447 --credentials-dir x", "tcp/10.0.0.1:7447 is plain text"),
        (
            "world --listen tls/10.0.0.1:7447",
            "invalid value: give either --keys, as made by 'rsc-swarm keys'",
        ),
        ("world --listen tls/10.0.0.1:7447 --keys /nowhere", "invalid value for '--keys'"),
        ("keys /proc/new", "/proc/new: cannot be made"),
        ("keys x --world 10.0.0.1:7447", "'10.0.0.1:7447' is not an address of the world: give"),
        ("keys x --swarm a/b", "'a/b' is not a swarm name"),
        ("world --listen tls/a --keys tests", "invalid value for '--listen': 'tls/a' is not an endpoint"),
        (
            "agent --agent 0 --connect tls/a --credentials pyproject.toml",
            "invalid value for '--connect': 'tls/a' is not an endpoint",
        ),
        ("agents 0 --connect a:1 --credentials-dir tests", "invalid value for '--connect': 'a:1' is not"),
        ("world", "invalid value: give --listen, where drones reach it"),
        (
            "keys x --fleet y --world z",
            "invalid value: --fleet: --world says nothing beside it; leave it out",
        ),
        ("mission --list -n 4", "invalid value: --list: --agents says nothing beside it; leave it out"),
        ("ground --fleet x --check --view --do go", "invalid value: --check: --do --view says nothing"),
        ("bench --twins 1 --against x", "invalid value: --twins: --against says nothing beside it"),
        ("bench --against /nowhere", "/nowhere: is no checkout of rsc-swarm"),
        ("campaign --check x --flights 3", "invalid value: --check: --flights says nothing beside it"),
        ("campaign plain --replay x", "invalid value: --replay: plain says nothing beside it"),
        ("nonsense", "no such command 'nonsense'"),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(run, arguments, line):
    code, out, err = run(*arguments.split())
    assert code == 2, err
    assert out == ""
    assert err.count("\n") == 1, err
    assert err.startswith(f"rsc-swarm: {line}")


def test_even_a_bug_is_one_line_and_exit_code_3(run, monkeypatch):
    def broken(*_: object) -> int:
        raise ZeroDivisionError("division by\nzero")

    monkeypatch.setattr("rsc_swarm.cli.fly.fly_once", broken)
    code, _, err = run("simulate")
    assert code == 3
    assert err.startswith(
        "rsc-swarm: unexpected ZeroDivisionError: division by zero (set RSC_SWARM_TRACEBACK=1"
    )
    assert err.count("\n") == 1


def test_a_broken_run_is_exit_code_3(run, monkeypatch):
    def broken(*_: object) -> int:
        raise RunBroken("agent 3 ended before the flight began")

    monkeypatch.setattr("rsc_swarm.cli.fly.fly_once", broken)
    code, _, err = run("launch")
    assert (code, err) == (3, "rsc-swarm: agent 3 ended before the flight began\n")


def test_the_mission_command_prints_what_would_be_flown(run, tmp_path):
    code, out, _ = run("mission", "--mission", "dense", "--agents", "9")
    assert code == 0
    file = tmp_path / "printed.yaml"
    file.write_text(out)
    assert run("mission", "--mission", str(file))[1] == out
    assert (
        run("mission", "--mission", str(file), "--check")[1]
        == f"{file}: can be flown by 9 agents, formation square, within 21 s\n"
    )
    assert "dense            A dense field" in run("mission", "--list")[1]


def test_evaluate_prints_a_row_and_the_failures_as_commands(run, tmp_path):
    file = tmp_path / "row.json"
    arguments = f"--agents 4 --set fly_s=0.3 --maps 2 --starts 2 --json {file}".split()
    code, out, _ = run("evaluate", *arguments)
    assert code == 0
    assert "| plain | 4 | rsc-h20 | 4 | 0.0 | 0.0-65.8 | 0.0 | 0.0 | 100.0 | - |" in out
    assert (
        "rsc-swarm simulate --agents 4 --set fly_s=0.3 --map 1 --seed 1001   # late: not in formation" in out
    )
    assert [failed["seed"] for failed in json.loads(file.read_text())["failures"]] == [0, 1, 1000, 1001]
    again = ["--agents", "4", "--set", "fly_s=0.3", "--map", "1", "--seed", "1001"]
    assert run("simulate", *again)[0] == 1


def test_help_and_version_answer_without_loading_anything_heavy():
    heavy = "{'numba', 'numpy', 'pydantic', 'matplotlib', 'zenoh', 'yaml'}"
    code = f"import sys, rsc_swarm.cli.main; print({heavy} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "set()\n"
    said = subprocess.run(
        [*COMMAND, "simulate", "--help"], capture_output=True, text=True, env={**os.environ, "NO_COLOR": "1"}
    )
    assert said.returncode == 0
    assert "rsc-swarm simulate --agents 36 --map 8" in said.stdout
    assert subprocess.run([*COMMAND, "--version"], capture_output=True, text=True).stdout.startswith(
        "rsc-swarm "
    )


@pytest.mark.parametrize(("verb", "stop"), [("simulate", signal.SIGINT), ("launch", signal.SIGTERM)])
def test_a_stopped_flight_is_told_and_kept_like_any_other(tmp_path, verb, stop):
    file = tmp_path / "report.json"
    arguments = [
        verb,
        "--agents",
        "4",
        "--clock",
        "realtime",
        "--run-dir",
        str(tmp_path / "run"),
        "--json",
        str(file),
    ]
    process = subprocess.Popen(
        [*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for said in process.stderr:  # it may say first that it compiles
        if said.startswith("t "):
            break
    process.send_signal(stop)
    process.send_signal(stop)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out.startswith("STOPPED: interrupted at t = ")
    assert json.loads(file.read_text())["failure"] == "interrupted"
    assert file.read_text() == (tmp_path / "run" / "report.json").read_text()
    assert (tmp_path / "run" / "trajectory.npz").is_file()


def test_a_launch_is_the_flight_of_the_simulation(run):
    arguments = ("--agents", "2", "--set", "fly_s=0.5", "--json", "-")
    reports = []
    for mode in ("simulate", "launch"):
        said = subprocess.run([*COMMAND, mode, *arguments], capture_output=True, text=True)
        assert said.returncode == 1, said.stderr
        reports.append(FlightReport.model_validate_json(said.stdout))
    simulated, launched = reports
    assert launched.mode == "launch"
    assert launched.digest == simulated.digest
    assert launched.frames == simulated.frames
    assert launched.first_tick_s is not None


def test_on_a_terminal_there_is_a_live_view_and_no_color_is_respected():
    main, inner = pty.openpty()
    environment = {**os.environ, "NO_COLOR": "1", "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "40"}
    arguments = [*COMMAND, "simulate", "--agents", "4", "--set", "fly_s=1"]
    with subprocess.Popen(arguments, stdout=inner, stderr=inner, env=environment) as process:
        os.close(inner)
        text = _read_all(main)
    assert process.returncode == 1
    assert "agent slot" in text
    assert "FAILED (late)" in text
    assert "\x1b[31m" not in text
    assert "\x1b[1;31m" not in text


def _read_all(descriptor: int) -> str:
    data, deadline = b"", time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            piece = os.read(descriptor, 65536)
        except OSError:  # the other side is closed
            break
        if not piece:
            break
        data += piece
    os.close(descriptor)
    return data.decode()


def test_the_help_of_every_command_fits_the_terminal(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("NO_COLOR", "1")
    for name in ("simulate", "launch", "evaluate", "plot", "mission", "world", "agent", "bench", "schema"):
        code, out, _ = run(name, "--help")
        assert code == 0, name
        assert f"Usage: rsc-swarm {name}" in out
        assert max(len(line) for line in out.splitlines()) <= 80


def test_nothing_is_written_where_nothing_was_asked(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run("simulate", "--agents", "1", "--set", "fly_s=0.1")
    run("evaluate", "--agents", "1", "--set", "fly_s=0.1", "--maps", "1", "--starts", "1")
    assert list(Path().iterdir()) == []


def test_a_name_that_cannot_be_written_into_a_report_is_refused_before_anything_is_flown(run, tmp_path):
    """It was flown, and then neither told nor kept."""
    strange = os.fsdecode(os.fsencode(tmp_path) + b"/r\xe9")
    code, out, err = run("simulate", "--agents", "4", "--run-dir", strange)
    assert (code, out) == (2, "")
    assert err == (
        f"rsc-swarm: {tmp_path}/r\\udce9: is no text in UTF-8, as which reports are written; give another name\n"
    )
