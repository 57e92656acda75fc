"""The keys of a terminal, one by one, for who gives orders that must not wait for Enter.

What stops or hangs a process at a terminal (Ctrl-Z, Ctrl-\\, Ctrl-S) does nothing while keys are read: drones whose operator
is not heard hold, and land. Ctrl-C is a signal as ever. What special keys send (the arrow up: ESC [ A) is no letter, and what is
pasted was not typed.
"""

import codecs
import os
import select
import sys
import termios
import tty
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

_TOGETHER_S = 0.5  # what a special key sends, and a paste, comes without such a pause
_PASTE, _PASTED = "\x1b[200~", "\x1b[201~"
_TELL_PASTES, _TELL_NONE = b"\x1b[?2004h", b"\x1b[?2004l"
_INPUT_FLAGS, _CHARACTERS = 0, 6  # places in what termios.tcgetattr returns
_READ_BYTES = 4096


class Keys:
    """Tells keys from the bytes that a terminal sends."""

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._begun, self._at = "", 0.0
        self._pasting = False

    def take(self, data: bytes, now: float) -> list[str]:
        """The keys in ``data``, which came at ``now`` [s]; Escape alone is none."""
        if now - self._at > _TOGETHER_S:
            self._begun, self._pasting = "", False
        keys = []
        for letter in self._decoder.decode(data):
            self._at = now
            begun = self._begun + letter
            if letter == "\x1b":
                self._begun = letter
            elif begun in ("\x1b[", "\x1bO") or (begun.startswith("\x1b[") and " " <= letter <= "?"):
                self._begun = begun
            else:
                self._begun = ""
                if begun in (_PASTE, _PASTED):
                    self._pasting = begun == _PASTE
                elif not self._pasting and begun[-2:-1] in ("", "\x1b"):
                    keys.append(letter)
        return keys


class Keyboard:
    """The keys of this process's terminal, within a ``with`` block; none where there is no terminal.

    Attributes:
        here: whether there is one, and it is ours.
    """

    def __init__(self, wanted: bool = True) -> None:
        self.here = wanted and _is_ours()
        self._keys = Keys()
        self._before: list[Any] | None = None

    def pressed(self, now: float) -> list[str] | None:
        """The keys that were pressed since the last call; None: the terminal is gone. Never waits."""
        keys: list[str] = []
        while self.here and select.select([sys.stdin], [], [], 0)[0]:
            try:
                data = os.read(sys.stdin.fileno(), _READ_BYTES)
            except OSError:
                data = b""
            if not data:
                self.here = False
                return None
            keys += self._keys.take(data, now)
        return keys

    def __enter__(self) -> Self:
        if self.here:
            number = sys.stdin.fileno()
            self._before = termios.tcgetattr(number)
            tty.setcbreak(number)
            now = termios.tcgetattr(number)
            now[_INPUT_FLAGS] &= ~termios.IXON
            for key in (termios.VSUSP, termios.VQUIT):
                now[_CHARACTERS][key] = b"\0"
            termios.tcsetattr(number, termios.TCSANOW, now)
            with suppress(OSError):
                os.write(number, _TELL_PASTES)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            with suppress(OSError, termios.error):
                os.write(sys.stdin.fileno(), _TELL_NONE)
                termios.tcsetattr(sys.stdin.fileno(), termios.TCSANOW, self._before)


def _is_ours() -> bool:
    """Whether this process may read the terminal: one in the background would be stopped."""
    try:
        return sys.stdin.isatty() and os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except (AttributeError, OSError, ValueError):  # closed, or none
        return False
