"""Files that are complete or not there, whatever happens while they are written."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from protocols.errors import BrokenError

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL


class WriteError(BrokenError):
    """A file cannot be written, because the disk is full, say; what was under its name before is untouched."""


@contextmanager
def whole_file(path: Path, private: bool = False) -> Iterator[BinaryIO]:
    """A file to write; at the end of the ``with`` block it is on the disk and takes the name ``path``.

    private: only its owner may read it.

    If the block raises, ``path`` stays as it was. What is no file, such as ``/dev/null``, is written to as it is; a link goes
    on leading where it leads.

    Raises:
        WriteError: one line names the file and says why.
    """
    try:
        if path.exists() and not path.is_file():
            with path.open("wb") as file:
                yield file
            return
        target = path.resolve()
        partial = target.with_name(f".{target.name}.{os.getpid()}")
        try:
            partial.unlink(missing_ok=True)
            with open(os.open(partial, _NEW, 0o600 if private else 0o666), "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise WriteError(f"{path}: cannot be written ({error.strerror or error})") from None


def write_whole(path: Path, content: str | bytes, private: bool = False) -> None:
    """Write ``content`` (text as UTF-8) as a `whole_file`.

    Raises:
        WriteError: one line names the file and says why.
    """
    with whole_file(path, private) as file:
        file.write(content.encode() if isinstance(content, str) else content)
