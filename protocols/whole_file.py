"""Files that are complete or not there, whatever happens while they are written.

A file has no name before it is complete, so even who is killed outright leaves nothing half written behind; only a file system
that knows no nameless files gets one whose name begins with a dot.
"""

import errno
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from protocols.errors import BrokenError


class WriteError(BrokenError):
    """A file cannot be written, because the disk is full, say; what was under its name before is untouched."""


@contextmanager
def whole_file(path: Path, private: bool = False) -> Iterator[BinaryIO]:
    """A file to write; at the end of the ``with`` block it is on the disk and takes the name ``path``.

    private: only its owner may read it.

    If the block raises, ``path`` stays as it was. What is no file, such as ``/dev/null``, is written to as it is; a link goes
    on leading where it leads. A pipe must have a reader by then: who waits for one could not even be asked to leave.

    Raises:
        WriteError: one line names the file and says why.
    """
    try:
        if is_no_file(path):
            with open(path, "wb", opener=_open_read) as file:
                yield file
            return
        target = path.resolve()
        partial = target.with_name(f".{target.name}.{os.getpid()}")
        try:
            with _nameless(partial, 0o600 if private else 0o666) as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
                if file.name != str(partial):
                    partial.unlink(missing_ok=True)  # of a process of this number, long ago
                    os.link(f"/proc/self/fd/{file.fileno()}", partial, src_dir_fd=file.fileno())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        unread = error.errno == errno.ENXIO
        why = "nobody reads from this pipe" if unread else error.strerror or error
        raise WriteError(f"{path}: cannot be written ({why})") from None


def is_no_file(path: Path) -> bool:
    """Whether something else than a file has this name, a pipe say. Raises OSError where links lead in a circle."""
    try:
        return not stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return False


def _open_read(path: str, flags: int) -> int:
    """Open what is no file, if somebody reads from it."""
    number = os.open(path, flags | os.O_NONBLOCK)
    os.set_blocking(number, True)
    return number


def _nameless(otherwise: Path, mode: int) -> BinaryIO:
    """A file without a name in the folder of ``otherwise``, or one with that name where there are no others."""
    try:
        return os.fdopen(os.open(otherwise.parent, os.O_TMPFILE | os.O_WRONLY, mode), "wb")
    except OSError:  # EOPNOTSUPP, EISDIR, EINVAL, ...: what really stands in the way, opening by name says
        otherwise.unlink(missing_ok=True)  # of a process of this number, long ago
        return open(otherwise, "wb", opener=lambda path, flags: os.open(path, flags, mode))


def write_whole(path: Path, content: str | bytes, private: bool = False) -> None:
    """Write ``content`` (text as UTF-8) as a `whole_file`.

    Raises:
        WriteError: one line names the file and says why.
    """
    with whole_file(path, private) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def keep_all(*saves: Callable[[], object]) -> None:
    """Call each; one that fails takes no other along.

    Raises:
        WriteError: one of them did, or several; the others have kept what they keep.
    """
    lost: list[str] = []
    for save in saves:
        try:
            save()
        except WriteError as error:
            lost.append(str(error))
    if lost:
        raise WriteError("; ".join(lost))
