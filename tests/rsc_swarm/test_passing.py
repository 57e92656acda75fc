"""What passes is gone whoever leaves and when; places that cannot be used are passed over or named."""

import errno
import os
import resource
import signal
import subprocess
import sys
from pathlib import Path
from threading import Thread

import pytest

from rsc_swarm.bench import bench as benches
from rsc_swarm.cli import main
from rsc_swarm.flight.socket_folder import RunFolder
from rsc_swarm.machine.leaving import leave_at_once, passing_folder
from rsc_swarm.machine.limits import MachineError, check_threads
from rsc_swarm.study.workers import WorkerError, told_in_a_line

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_leaves_at_once_takes_its_passing_folders_along(tmp_path: Path, number: signal.Signals) -> None:
    lines = (
        "import signal, sys; from pathlib import Path",
        "from rsc_swarm.machine.leaving import leave_at_once, passing_folder",
        "leave_at_once()",
        "with passing_folder('x-', Path(sys.argv[1])) as folder:",
        "    (folder / 'half a film').write_text('...')",
        "    signal.raise_signal(int(sys.argv[2]))",
    )
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(lines), str(tmp_path), str(int(number))],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (130, "rsc-swarm: stopped\n")
    assert list(tmp_path.iterdir()) == []


def test_a_child_leaves_the_passing_folders_of_its_parent(tmp_path: Path) -> None:
    with passing_folder("x-", tmp_path) as folder:
        child = os.fork()
        if child == 0:
            leave_at_once()
            signal.raise_signal(signal.SIGTERM)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 130
        assert folder.is_dir()
    assert list(tmp_path.iterdir()) == []


def test_what_who_was_killed_outright_left_goes_with_the_next_of_its_name(tmp_path: Path) -> None:
    """But for what lives, whatever its age; and for what only looks alike."""
    (tmp_path / "x-10").mkdir()
    with passing_folder("x-", tmp_path) as alive, passing_folder("y-", tmp_path) as other:
        child = os.fork()
        if child == 0:
            with passing_folder("x-", tmp_path) as folder:
                (folder / "half a page").write_text("...")
                os.kill(os.getpid(), signal.SIGKILL)
        os.waitpid(child, 0)
        left = set(tmp_path.glob("x-????????")) - {alive}
        assert len(left) == 1
        for folder in tmp_path.iterdir():
            os.utime(folder, (0, 0))
        with passing_folder("x-", tmp_path) as new:
            assert set(tmp_path.iterdir()) == {tmp_path / "x-10", alive, other, new}


@pytest.mark.parametrize("name", ["a?b", "a#b", "a\nb", "a\udcffb"])
def test_a_runtime_folder_that_can_stand_in_no_address_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / name).mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / name))
    with RunFolder() as folder:
        assert folder.path.parent != tmp_path / name


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.EMFILE, r"too many open files, \d+ are allowed here: allow more \(ulimit -n\)"),
        (errno.EAGAIN, r".*: allow more processes \(ulimit -u\) or more memory"),
        (errno.EFBIG, r"File too large: make room .*\(ulimit -f\)"),
        (errno.EHOSTDOWN, r"Host is down"),
    ],
)
def test_what_keeps_workers_from_working_is_told_as_everywhere(number: int, said: str) -> None:
    with pytest.raises(WorkerError, match=f"^{said}; run it again to go on$"), told_in_a_line():
        raise OSError(number, os.strerror(number))


def test_too_few_threads_are_told_before_a_library_misses_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def none_left(_: Thread) -> None:
        raise RuntimeError("can't start new thread")

    check_threads()
    monkeypatch.setattr(resource, "getrlimit", lambda _: (7, 7))
    check_threads()  # few, and enough
    monkeypatch.setattr(Thread, "start", none_left)
    with pytest.raises(MachineError, match=r"7 processes .* too few: allow more \(ulimit -u\)"):
        check_threads()


def test_who_is_asked_to_leave_says_so_where_no_command_does(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def asked(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(benches, "bench", asked)
    assert main._carry_out(["bench", "--quick"]) == 130
    assert capsys.readouterr().err.splitlines() == ["rsc-swarm: stopped"]


def test_what_libraries_do_while_python_leaves_does_not_change_that_it_was_stopped() -> None:
    lines = (
        "import atexit, signal, sys",
        "from rsc_swarm.bench import bench as benches; from rsc_swarm.cli.main import main",
        "def killed():",
        "    signal.signal(signal.SIGINT, signal.SIG_DFL)",
        "    signal.raise_signal(signal.SIGINT)",
        "atexit.register(killed)",
        "def asked(*_):",
        "    print('half a figure')",
        "    raise KeyboardInterrupt",
        "benches.bench = asked",
        "sys.argv = ['rsc-swarm', 'bench', '--quick']",
        "main()",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (130, "half a figure\n")
