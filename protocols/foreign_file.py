"""Files that somebody gives us: read, but no more of them than can be."""

import errno
from pathlib import Path

_MOST_BYTES, _PART_BYTES = 256 << 20, 1 << 20


def read_file(path: Path, most: int = _MOST_BYTES) -> bytes:
    """What is in a file of at most so many bytes; a name may lead to ``/dev/zero``.

    Raises:
        OSError: it cannot be read, or is longer.
    """
    data = bytearray()
    with path.open("rb") as file:
        while part := file.read(_PART_BYTES):  # all at once would take as much memory as there may be
            data += part
            if len(data) > most:
                limit = f"{most >> 20} MiB" if most >> 20 else f"{most >> 10} KiB"
                raise OSError(errno.EFBIG, f"it is longer than {limit}")
    return bytes(data)
