"""Files that somebody gives us: read, but no more of them than can be."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

_MOST_BYTES, _PART_BYTES = 256 << 20, 1 << 20


@contextmanager
def opened_file(path: Path) -> Iterator[BinaryIO]:
    """A file to read: no pipe or device, for which one could wait for ever.

    Raises:
        OSError: it cannot be read, or is none.
    """
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is no file")
        yield file


def read_file(path: Path, most: int = _MOST_BYTES) -> bytes:
    """What is in a file of at most so many bytes.

    Raises:
        OSError: it cannot be read, or is longer.
    """
    data = bytearray()
    with opened_file(path) as file:
        while part := file.read(_PART_BYTES):  # all at once would take as much memory as there may be
            data += part
            if len(data) > most:
                limit = f"{most >> 20} MiB" if most >> 20 else f"{most >> 10} KiB"
                raise OSError(errno.EFBIG, f"it is longer than {limit}")
    return bytes(data)
