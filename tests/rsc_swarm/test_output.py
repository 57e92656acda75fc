"""What commands make, and where it goes: nothing that was flown is lost, nothing lies where it was not asked for."""

import json
import os

ONE_FLIGHT = (
    "evaluate",
    *["--agents", "1", "--set", "fly_s=0.1", "--maps", "1", "--starts", "1", "--workers", "1"],
)


def test_an_evaluation_is_told_where_its_file_cannot_be_written(run):
    """It was flown, and then neither told nor kept."""
    code, out, err = run(*ONE_FLIGHT, "--json", "/dev/full")
    assert code == 3
    assert err == "rsc-swarm: /dev/full: cannot be written (No space left on device)\n"
    assert out.splitlines()[-1].startswith("The row again:  rsc-swarm evaluate")


def test_no_journal_is_left_beside_a_pipe_or_a_device(run, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    assert run(*ONE_FLIGHT, "--json", str(pipe))[0] == 0
    assert json.loads(os.read(reader, 1 << 16))["runs"] == 1
    os.close(reader)
    assert list(tmp_path.iterdir()) == [pipe]


def test_a_link_that_leads_nowhere_is_refused_before_anything_is_flown(run, tmp_path):
    circle = tmp_path / "circle"
    circle.symlink_to(circle)
    for words in (("evaluate", "--json"), ("simulate", "--json"), ("simulate", "--mcap"), ("plot", "--out")):
        code, out, err = run(*words, str(circle))
        assert (code, out) == (2, "")
        assert err == f"rsc-swarm: {words[1]} {circle}: give a file in a directory that exists\n"


def test_a_name_that_no_flight_can_have_is_bad_usage(run):
    for words in ("report", "plot", "replay"):
        code, _, err = run(words, "x" * 300)
        assert (code, err.count("\n")) == (2, 1)
        assert "no flight recorded here" in err


def test_what_broke_a_launch_of_the_bench_is_said(run):
    code, _, err = run("bench", "--agents", "300")
    assert code == 2
    assert "fly at most 250" in err.splitlines()[-1]


def test_the_picture_of_a_kept_flight_is_called_as_the_help_says(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run("simulate", "--agents", "1", "--set", "fly_s=0.1", "--run-dir", "flights/1")
    assert run("plot", "flights/1")[1].startswith("flight.png: ")


def test_of_two_flights_to_draw_neither_is_silently_left_out(run, tmp_path):
    code, _, err = run("plot", "one", "--run-dir", "other")
    assert code == 2
    assert err == "rsc-swarm: one --run-dir other: these are different pictures; give one\n"
