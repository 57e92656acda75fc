"""What the machine does to a command: signals at bad moments, full disks, closed streams, too little of everything.

Whatever it is: one line says what is wrong, no traceback, nothing left behind, and what was flown is kept.
"""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rsc_swarm.flight.key_files import make_login_files
from rsc_swarm.machine.limits import TooManyError, make_room
from rsc_swarm.machine.service import Service

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "rsc_swarm"]
SHORT = ["simulate", "--agents", "2", "--set", "fly_s=0.3"]  # and so it fails: exit code 1


Said = subprocess.CompletedProcess[str]


def run(*words: str, sh: str = "", env: dict[str, str] | None = None, **more: object) -> Said:
    """Run the command; ``sh``: through a shell, with these redirections."""
    command = ["sh", "-c", f'"$@" {sh}', "sh", *COMMAND, *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **(env or {})}
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=200, **more)  # type: ignore[call-overload]


def complaints(said: Said) -> list[str]:
    return [line for line in said.stderr.splitlines() if not line.startswith(("t ", "compiling"))]


# --- streams -----------------------------------------------------------------------------------------------


FULL, CLOSED = (">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")


@pytest.mark.parametrize(
    ("words", "stream"),
    [
        (SHORT, FULL),
        (SHORT, CLOSED),
        ([*SHORT, "--json", "-"], FULL),
        (["schema"], CLOSED),
        (["--help"], FULL),
    ],
)
def test_a_stdout_that_cannot_be_written_is_told_in_one_line(
    words: list[str], stream: tuple[str, str]
) -> None:
    redirection, why = stream
    said = run(*words, sh=redirection)
    assert said.returncode == 3
    shown = [line for line in complaints(said) if line.startswith("rsc-swarm: ")]
    assert shown == [f"rsc-swarm: stdout: cannot be written ({why})"]
    assert "Traceback" not in said.stderr
    assert "Exception" not in said.stderr


def test_what_cannot_be_printed_is_kept_all_the_same(tmp_path: Path) -> None:
    said = run(
        *SHORT, "--run-dir", str(tmp_path / "run"), "--json", str(tmp_path / "x.json"), sh=">/dev/full"
    )
    assert said.returncode == 3
    assert (tmp_path / "x.json").read_text() == (tmp_path / "run" / "report.json").read_text()
    assert (tmp_path / "run" / "trajectory.npz").is_file()


@pytest.mark.parametrize("redirection", ["2>/dev/full", "2>&-", "<&- 2>&-"])
def test_a_stderr_that_cannot_be_written_costs_nothing(redirection: str) -> None:
    said = run(*SHORT, sh=redirection)
    assert said.returncode == 1
    assert said.stdout.startswith("FAILED (late)")


def test_who_stops_reading_has_had_enough() -> None:
    said = run(*SHORT, sh="| head -1")
    assert said.stdout.startswith("FAILED (late)")
    assert complaints(said) == []
    assert complaints(run("launch", "--help", sh="| head -1")) == []


def test_what_a_stream_cannot_encode_is_spelled_out() -> None:
    said = run("mission", "--set", "name=µ", env={"PYTHONIOENCODING": "ascii"})
    assert (said.returncode, "name: " in said.stdout) == (0, True)
    said = run("mission", "--mission", "µ", env={"PYTHONIOENCODING": "ascii"})
    assert (said.returncode, said.stderr.startswith(r"rsc-swarm: --mission \xb5: no such file")) == (2, True)


def test_a_terminal_of_one_column_shows_the_report() -> None:
    assert run(*SHORT, env={"COLUMNS": "1", "LINES": "1"}).returncode == 1


# --- folders -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "environment",
    [
        {"HOME": "/nonexistent", "XDG_CACHE_HOME": ""},
        {"HOME": "", "XDG_CACHE_HOME": "relative"},
        {"HOME": "relative", "XDG_CACHE_HOME": "/dev/null"},
        {"HOME": "/proc", "XDG_CACHE_HOME": "/proc", "TMPDIR": "/nonexistent"},
    ],
)
def test_nowhere_to_keep_compiled_rules_is_no_error_and_leaves_nothing(
    tmp_path: Path, environment: dict[str, str]
) -> None:
    code = "from protocols.kept import cache_folder; f = cache_folder(); print(f is None or f.is_absolute())"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path / "tmp"), **environment}
    (tmp_path / "tmp").mkdir()
    said = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert (said.stdout, said.stderr) == ("True\n", "")
    assert [path.name for path in tmp_path.iterdir()] == ["tmp"]


def test_a_folder_that_is_gone_is_named() -> None:
    words = " ".join([*COMMAND, *SHORT, "--run-dir", "x"])
    said = subprocess.run(
        ["sh", "-c", f'd=$(mktemp -d); cd "$d"; rmdir "$d"; {words}'],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert said.returncode == 3
    assert complaints(said) == ["rsc-swarm: the folder in which this was started is gone: start from another"]


# --- too little of everything ------------------------------------------------------------------------------


def test_too_few_open_files_are_told_before_anything_is_started() -> None:
    few = (40, 40)
    said = run("launch", "--agents", "25", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, few))
    line = "rsc-swarm: 98 open files are needed, and 40 are allowed here: allow more (ulimit -n 98)"
    assert (said.returncode, complaints(said)) == (3, [line])


def test_what_may_be_raised_is_raised() -> None:
    few = (40, 4096)
    said = run(
        "launch", "--agents", "8", "--set", "fly_s=0.1",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, few),
    )  # fmt: skip
    assert (said.returncode, complaints(said)) == (1, [])


@pytest.mark.parametrize(("hard", "raised"), [(4096, 1556), (1000, 1000), (resource.RLIM_INFINITY, 1556)])
def test_strangers_who_knock_at_the_world_do_not_take_the_files_that_it_needs(
    monkeypatch: pytest.MonkeyPatch, hard: int, raised: int
) -> None:
    limits = {resource.RLIMIT_NOFILE: (256, hard)}
    monkeypatch.setattr(resource, "getrlimit", lambda which: limits.get(which, (resource.RLIM_INFINITY,) * 2))
    monkeypatch.setattr(resource, "setrlimit", limits.__setitem__)
    make_room(4)
    assert limits[resource.RLIMIT_NOFILE] == (raised, hard)


@pytest.mark.parametrize(
    ("verb", "little", "needed"), [("launch", 1500, 2048), ("launch", 485, 1024), ("simulate", 485, 1024)]
)
def test_too_little_memory_is_told_before_anything_is_started(verb: str, little: int, needed: int) -> None:
    said = run(verb, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, 2 * (little << 20,)))
    line = f"a process may have {little} MiB of addresses here, and needs {needed}: allow more (ulimit -v {needed << 10})"
    assert (said.returncode, complaints(said)) == (3, [f"rsc-swarm: {line}"])


# --- signals -----------------------------------------------------------------------------------------------


def begun(*words: str, **more: object) -> "subprocess.Popen[str]":
    """The command, from the moment on in which it answers signals itself."""
    process = subprocess.Popen(
        [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, **more,
    )  # fmt: skip
    while not all(is_decided(process.pid, number) for number in (signal.SIGTERM, signal.SIGHUP)):
        assert process.poll() is None
        time.sleep(0.001)
    return process


def is_decided(pid: int, number: signal.Signals) -> bool:
    """Whether the process answers this signal, or ignores it."""
    status = Path(f"/proc/{pid}/status").read_text()
    sets = [line.split()[1] for line in status.splitlines() if line.startswith(("SigCgt:", "SigIgn:"))]
    return any(int(numbers, 16) >> (number - 1) & 1 for numbers in sets)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_leaves_while_all_is_being_imported_leaves_at_once(number: signal.Signals) -> None:
    process = begun("simulate")
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (130, "", "rsc-swarm: stopped\n")


@pytest.mark.parametrize("after_s", [0.1, 0.3, 0.6, 1.0])
def test_whenever_it_comes_ctrl_c_is_no_traceback(after_s: float) -> None:
    process = begun("launch", "--agents", "3", start_new_session=True)
    time.sleep(after_s)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    assert "stopped" in err or out.startswith("STOPPED")


def test_what_whoever_started_it_wants_ignored_stays_ignored() -> None:
    process = begun(*SHORT, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))  # nohup
    process.send_signal(signal.SIGHUP)
    assert process.wait(60) == 1


@pytest.mark.skipif(os.getuid() != 0, reason="a process is the first one of a container only for root")
def test_as_the_first_process_of_a_container_it_leaves_when_it_is_asked(tmp_path: Path) -> None:
    file = tmp_path / "report.json"
    endless = ["--set", "goal_x_m=1e6", "--set", "fly_s=3600", "--set", "obstacles.discs=[]"]
    process = subprocess.Popen(
        ["unshare", "--pid", "--fork", "--kill-child", *COMMAND, "launch", "--agents", "2", *endless, "--json", str(file)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    next(line for line in process.stderr or () if line.startswith("t "))
    (inside,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    os.kill(int(inside), signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out.startswith("STOPPED: interrupted at t = ")
    assert json.loads(file.read_text())["first_tick_s"] < 60  # in the machine's /proc process 1 is another


# --- disks -------------------------------------------------------------------------------------------------


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk with room for a mission and its logs, not for a flight."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", disk], capture_output=True
    ).returncode:
        pytest.skip("a disk can be mounted only by root")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


@pytest.mark.parametrize("verb", ["simulate", "launch"])
def test_a_full_disk_is_one_line_and_what_was_flown_is_told_and_sent(
    tiny_disk: Path, tmp_path: Path, verb: str
) -> None:
    sent = tmp_path / "sent.json"
    said = run(
        verb, "--agents", "4", "--set", "fly_s=4", "--run-dir", str(tiny_disk / "run"), "--json", str(sent)
    )
    assert said.returncode == 3
    assert said.stdout.startswith("FAILED (late)")
    (line,) = complaints(said)
    assert line.startswith(
        f"rsc-swarm: {tiny_disk}/run/trajectory.npz: cannot be written (No space left on device)"
    )
    assert sent.is_file()
    assert [path.name for path in (tiny_disk / "run").iterdir() if path.name.startswith(".")] == []


def test_a_disk_without_any_room_is_told_before_anything_is_flown(tiny_disk: Path) -> None:
    (tiny_disk / "all").write_bytes(bytes(16384))
    said = run("launch", "--agents", "2", "--run-dir", str(tiny_disk / "run"))
    assert (said.returncode, len(complaints(said))) in ((2, 1), (3, 1))
    assert "cannot be written (No space left on device)" in said.stderr


# --- a service manager -------------------------------------------------------------------------------------


@pytest.mark.parametrize("abstract", [False, True])
def test_a_service_says_that_it_is_ready_and_that_it_lives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, abstract: bool
) -> None:
    address = f"@rsc-swarm-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(address.replace("@", "\0"))
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        monkeypatch.setenv("WATCHDOG_USEC", "100000")
        monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
        service = Service()
        service.ready("waiting")
        assert [service.alive(False), service.alive(False), service.alive(True)] == [False, False, True]
        time.sleep(0.06)
        service.alive(False)
        said = [manager.recv(100) for _ in range(3)]
        assert said == [b"READY=1\nSTATUS=waiting", b"WATCHDOG=1", b"WATCHDOG=1"], "not at every tick"
        for _ in range(1000):  # nobody reads: nobody waits for that
            service.ready("still there")


@pytest.mark.parametrize(
    "environment",
    [{}, {"WATCHDOG_USEC": "x"}, {"WATCHDOG_USEC": "1", "WATCHDOG_PID": "1"}, {"NOTIFY_SOCKET": "/nowhere"}],
)
def test_without_a_service_manager_nothing_happens(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str]
) -> None:
    for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    service = Service()
    service.ready("waiting")
    assert service.alive(True)
    assert not service.alive(False)


def test_a_drone_that_looks_for_a_world_tells_its_service_manager_and_leaves_when_asked(
    tmp_path: Path,
) -> None:
    make_login_files(tmp_path / "keys", "rsc", 1)
    login = tmp_path / "keys" / "agent-0.json"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(180)
        process = subprocess.Popen(
            [*COMMAND, "agent", "--agent", "0", "--connect", "tcp/127.0.0.1:1", "--credentials", str(login)],
            env={**os.environ, "PYTHONPATH": str(ROOT), "RSC_SWARM_PYTHON_KERNELS": "1",
                 "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "200000"},
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        said = [manager.recv(100) for _ in range(4)]
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=60)
    assert said == [b"READY=1\nSTATUS=looking for the world at tcp/127.0.0.1:1", *[b"WATCHDOG=1"] * 3]
    assert (process.returncode, err.splitlines()[-1]) == (130, "agent 0: asked to leave")


def test_more_drones_than_processes_can_talk_are_refused_before_anything_starts() -> None:
    with pytest.raises(
        TooManyError,
        match=r"agents: 251 drones are too many for a process each: fly at most 250, or use simulate",
    ):
        make_room(251)
