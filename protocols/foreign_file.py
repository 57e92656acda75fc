"""Files that somebody gives us: read, but no more of them than can be."""

import errno
from pathlib import Path

_MOST_BYTES = 256 << 20


def read_file(path: Path, most: int = _MOST_BYTES) -> bytes:
    """What is in a file of at most so many bytes; a name may lead to ``/dev/zero``.

    Raises:
        OSError: it cannot be read, or is longer.
    """
    with path.open("rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"it is longer than {most >> 20} MiB")
    return data
