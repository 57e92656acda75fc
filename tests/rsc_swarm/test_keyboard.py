"""Keys at a terminal: each is a key at once; what special keys send, and what is pasted, is none."""

import os
import pty
import sys
import termios
from collections.abc import Iterator
from contextlib import suppress

import pytest

from rsc_swarm.show.keyboard import Keyboard, Keys


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"land\r", "land\r"),
        (b"K", "K"),
        ("hö".encode(), "hö"),
        (b"\xff", "\ufffd"),
        (b"\x1b[A\x1b[B\x1bOA\x1bOK", ""),  # arrows, F-keys
        (b"\x1b[1;5A\x1b[3~x", "x"),
        (b"\x1b[200~TAKEOFF\nK\x1b[201~l", "l"),  # a paste
        (b"\x1bK", "K"),  # Escape, then K; or Alt and K
        (b"\x1b\x1bK", "K"),
    ],
)  # fmt: skip
def test_what_a_terminal_sends_is_told_apart(sent: bytes, keys: str) -> None:
    assert "".join(Keys().take(sent, 1.0)) == keys
    piece_by_piece = Keys()
    assert (
        "".join(key for at in range(len(sent)) for key in piece_by_piece.take(sent[at : at + 1], 1.0)) == keys
    )


@pytest.mark.parametrize("begun", [b"\x1b", b"\x1b[", b"\x1bO", b"\x1b[200~", b"\x1b[200~nonsense"])
def test_what_was_begun_long_ago_swallows_no_key(begun: bytes) -> None:
    keys = Keys()
    assert keys.take(begun, 1.0) == []
    assert keys.take(b"K", 2.0) == ["K"]


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The operator's end of a terminal whose other end is this process's stdin, as if it were in front there."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r", closefd=False) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda number: os.getpgrp())
        yield ours
    for number in (ours, theirs):
        with suppress(OSError):  # a test has closed it
            os.close(number)


def test_keys_that_come_together_are_all_there_at_once(terminal: int) -> None:
    with Keyboard() as keyboard:
        assert keyboard.pressed(1.0) == []
        os.write(terminal, b"hold\rK")
        assert keyboard.pressed(1.1) == list("hold\nK")
        assert keyboard.pressed(1.2) == []


def test_no_key_stops_who_reads_them_and_the_terminal_is_as_it_was_afterwards(terminal: int) -> None:
    number = sys.stdin.fileno()
    before = termios.tcgetattr(number)
    with Keyboard() as keyboard:
        os.write(terminal, b"\x1a\x1c\x13")  # Ctrl-Z, Ctrl-\, Ctrl-S
        assert keyboard.pressed(1.0) == ["\x1a", "\x1c", "\x13"]
        assert os.write(number, b"not held back") == 13
    assert termios.tcgetattr(number) == before


def test_a_terminal_that_is_gone_is_told_once(terminal: int) -> None:
    with Keyboard() as keyboard:
        os.close(terminal)
        assert keyboard.pressed(1.0) is None
        assert keyboard.pressed(1.1) == []
        assert not keyboard.here


def test_without_a_terminal_or_unasked_there_are_no_keys(
    terminal: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not Keyboard(wanted=False).here
    monkeypatch.setattr(os, "tcgetpgrp", lambda number: os.getpgrp() + 1)  # in the background
    assert not Keyboard().here
    monkeypatch.setattr(sys, "stdin", None)
    with Keyboard() as keyboard:
        assert keyboard.pressed(1.0) == []
