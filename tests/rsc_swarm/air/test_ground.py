"""The operator's command at a terminal and without one; nobody is in the air."""

import fcntl
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.scenarios.fleets import Fleet

GROUND = [sys.executable, "-m", "rsc_swarm", "ground", "--fleet"]


class Terminal:
    """A terminal at which the operator's command runs."""

    def __init__(self, file: Path) -> None:
        self._ours, theirs = pty.openpty()
        self.said = ""
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, b"\x18\0\x50\0\0\0\0\0")  # 24 lines of 80
        self._before = termios.tcgetattr(theirs)
        self._theirs = theirs
        self.process = subprocess.Popen(
            [*GROUND, str(file)], stdin=theirs, stdout=theirs, stderr=theirs, preexec_fn=self._in_front,
            env={**os.environ, "TERM": "xterm", "PYTHONDONTWRITEBYTECODE": "1"},
        )  # fmt: skip

    def _in_front(self) -> None:
        os.setsid()
        fcntl.ioctl(self._theirs, termios.TIOCSCTTY, 0)

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def until(self, words: str, seconds: float = 30.0) -> None:
        """Read until this has been shown."""
        deadline = time.monotonic() + seconds
        while words not in re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]|\s+", " ", self.said):
            assert time.monotonic() < deadline, self.said
            if select.select([self._ours], [], [], 0.1)[0]:
                self.said += os.read(self._ours, 65536).decode(errors="replace")

    def left(self) -> int:
        """How it ended. Somebody has to read what it says."""
        while self.process.poll() is None:
            if select.select([self._ours], [], [], 0.05)[0]:
                with suppress(OSError):
                    self.said += os.read(self._ours, 65536).decode(errors="replace")
        return self.process.returncode

    @property
    def as_before(self) -> bool:
        return termios.tcgetattr(self._theirs) == self._before

    def close(self) -> None:
        for number in (self._ours, self._theirs):
            with suppress(OSError):
                os.close(number)


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    made = Terminal(Fleet(tmp_path).file)
    yield made
    made.process.kill()
    made.process.wait()
    made.close()


def test_an_operator_types(terminal: Terminal) -> None:
    terminal.until("drone 5: is not heard at udp/127.0.0.1")
    terminal.press(b"arm\r")
    terminal.until("arm: preflight is not green: drone 0: is not heard")
    terminal.press(b"lift off\r")
    terminal.until("'lift off' is no order; known: preflight, arm")
    terminal.press(b"\x1b[A\x1a\x1c\x13")  # nothing to a key that is none, or would stop it
    terminal.press(b"hol")
    terminal.until("> hol ")
    terminal.press(b"K")
    terminal.until("ordered: kill")
    terminal.press(b"quit\r")
    assert terminal.left() == 0
    assert terminal.as_before


def test_ctrl_c_leaves_and_the_terminal_is_as_it_was(terminal: Terminal) -> None:
    terminal.until("is not heard at")
    terminal.press(b"\x03")
    assert terminal.left() == 130
    assert terminal.as_before


def test_an_operator_whose_terminal_is_closed_leaves(terminal: Terminal) -> None:
    terminal.until("is not heard at")
    terminal.close()
    assert terminal.process.wait(30) == 130


def test_without_a_terminal_it_tells_in_lines(tmp_path: Path) -> None:
    run = subprocess.Popen(
        [*GROUND, str(Fleet(tmp_path).file)], stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert run.stderr
    lines = [run.stderr.readline() for _ in range(2)]
    run.send_signal(signal.SIGTERM)
    run.communicate(timeout=30)
    assert run.returncode == 130
    assert lines[0].startswith("no terminal to type at: give orders with --do")
    assert lines[1].startswith("drone 0: is not heard at udp/127.0.0.1")


def test_there_is_one_operator(terminal: Terminal, tmp_path: Path) -> None:
    terminal.until("is not heard at")
    second = subprocess.run(
        [*GROUND, str(tmp_path / "fleet.yaml")], capture_output=True, text=True, timeout=60
    )
    assert second.returncode == 3
    (line,) = second.stderr.strip().splitlines()[-1:]
    assert "another program does. Is this fleet in the air already, or has it an operator?" in line
