"""What is said when it cannot be said: streams that are closed, full or read by nobody any more.

stdout is what was asked for, so that it could not be written is told, once, by a WriteError; only who has stopped reading
(``| head``) has had enough. stderr keeps company: a full disk behind it, or none, ends no flight. Characters that a stream
cannot encode are spelled out.
"""

import io
import os
import sys

from protocols.whole_file import WriteError


class _Told(io.FileIO):
    """Raises at the first failure, and takes everything afterwards: nothing is left to fail while Python is leaving."""

    _failed = False

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        if self._failed:
            return len(data)
        try:
            return super().write(data) or len(data)
        except BrokenPipeError:
            self._failed = True
            return len(data)
        except OSError as error:
            self._failed = True
            raise WriteError(f"stdout: cannot be written ({error.strerror})") from None


class _Company(io.FileIO):
    """Never fails."""

    def write(self, data: bytes, /) -> int:  # type: ignore[override]
        try:
            return super().write(data) or len(data)
        except OSError:
            return len(data)


def stand_by_streams() -> None:
    """Put these in the place of Python's own, unless others have (a test).

    Closed ones are opened, so that no file or socket takes their number, and with it what others write there.
    """
    for number, access in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, access)  # for stdout one that cannot be written: who prints there is told
    if sys.stdout is sys.__stdout__:
        sys.stdout = _text(_Told(1, "w", closefd=False), sys.__stdout__)
    if sys.stderr is sys.__stderr__:
        sys.stderr = mute_stream(2)


def mute_stream(number: int) -> io.TextIOWrapper:
    """Text by lines into file descriptor ``number``; what cannot be written there is dropped."""
    return _text(_Company(number, "w", closefd=False), sys.__stderr__)


def _text(raw: io.RawIOBase, before: object) -> io.TextIOWrapper:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=getattr(before, "encoding", None) or "utf-8",
        errors="backslashreplace",
        line_buffering=isinstance(raw, _Company) or raw.isatty(),
    )
