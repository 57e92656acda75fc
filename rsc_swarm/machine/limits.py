"""What the machine lacks, in one line that says what would be right."""

import errno
import resource
from pathlib import Path

from protocols.errors import BrokenError

# Of the world, which needs most: it was seen to have 27 files open with 4 drones, 63 with 40, and 1.4 GiB of addresses.
_FILES, _FILES_PER_DRONE = 48, 2
_ADDRESS_SPACE = 2 << 30  # bytes


class MachineError(BrokenError):
    """The machine gives too little; one line says of what."""


def make_room(drones: int) -> None:
    """Allow this process and its children the open files that a flight of ``drones`` needs.

    Raises:
        MachineError: it may not have them, or too little memory, which would show as something else, and late.
    """
    needed = _FILES + _FILES_PER_DRONE * drones
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        if hard != resource.RLIM_INFINITY and hard < needed:
            raise MachineError(
                f"{needed} open files are needed, and {hard} are allowed here: allow more (ulimit -n {needed})"
            )
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    space = resource.getrlimit(resource.RLIMIT_AS)[0]
    if space != resource.RLIM_INFINITY and space < _ADDRESS_SPACE:
        raise MachineError(
            f"a process may have {space >> 20} MiB of addresses here, and needs {_ADDRESS_SPACE >> 20}: "
            f"allow more (ulimit -v {_ADDRESS_SPACE >> 10})"
        )


def lacking(error: BaseException) -> str | None:
    """What the machine lacks, if that is what ``error`` says."""
    if isinstance(error, MemoryError):
        return "out of memory: allow more, or fly fewer drones"
    if not isinstance(error, OSError) or error.errno is None:
        return None
    if error.errno in (errno.EMFILE, errno.ENFILE):
        allowed = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        return f"too many open files, {allowed} are allowed here: allow more (ulimit -n)"
    if error.errno == errno.ENOENT and not _has_folder():
        return "the folder in which this was started is gone: start from another"
    if error.errno in (errno.EAGAIN, errno.ENOMEM):
        return f"{error.strerror}: allow more processes (ulimit -u) or more memory"
    return f"{error.filename}: {error.strerror}" if error.filename else error.strerror


def _has_folder() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return False
    return True
