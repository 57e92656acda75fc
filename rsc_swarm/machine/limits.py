"""What the machine lacks, in one line that says what would be right."""

import errno
import math
import os
import resource
from pathlib import Path
from threading import Event, Thread

from protocols.errors import BrokenError, SwarmError
from protocols.wire.keys import MAX_AGENTS
from protocols.wire.transport import MOST_KNOCKING, MOST_SESSIONS

# Of the world, which needs most: it was seen to have 27 files open with 4 drones, 63 with 40, and 1.4 GiB of addresses.
_FILES, _FILES_PER_DRONE = 48, 2
_PLENTY = 1024  # processes of a user
_SHARED = "/dev/shm"
_ADDRESSES, _ADDRESSES_OF_WORLD = 1 << 30, 2 << 30  # bytes


class MachineError(BrokenError):
    """The machine gives too little; one line says of what."""


class TooManyError(SwarmError):
    """More drones are asked for than can be processes of their own; one line says how many can."""


def make_room(drones: int) -> None:
    """Allow this process and its children the open files that a flight of ``drones`` needs.

    Raises:
        TooManyError: so many drones cannot talk. MachineError: it may not have the files, or too little memory, which would
            show as something else, and late.
    """
    if drones > MAX_AGENTS:
        raise TooManyError(
            f"agents: {drones} drones are too many for a process each: fly at most {MAX_AGENTS}, or use simulate or evaluate"
        )
    needed = _FILES + _FILES_PER_DRONE * drones
    allowed = resource.getrlimit(resource.RLIMIT_NOFILE)
    soft, hard = (_number(limit) for limit in allowed)
    if hard < needed:
        raise MachineError(
            f"{needed} open files are needed, and {hard} are allowed here: allow more (ulimit -n {needed})"
        )
    # Whoever knocks at the world takes a file of it, and may be a stranger.
    wished = min(hard, needed + MOST_KNOCKING + MOST_SESSIONS)
    if soft < wished:
        resource.setrlimit(resource.RLIMIT_NOFILE, (int(wished), allowed[1]))
    check_addresses(_ADDRESSES_OF_WORLD)


def _number(limit: int) -> float:
    return math.inf if limit == resource.RLIM_INFINITY else limit


def check_addresses(needed: int = _ADDRESSES) -> None:
    """Look whether this process may have so many bytes of addresses; with less, libraries hang while they are imported.

    Raises:
        MachineError: it may not.
    """
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed != resource.RLIM_INFINITY and allowed < needed:
        raise MachineError(
            f"a process may have {allowed >> 20} MiB of addresses here, and needs {needed >> 20}: "
            f"allow more (ulimit -v {needed >> 10})"
        )


def check_threads() -> None:
    """Look whether this process may start a thread for each processor, where few are allowed: a library that may not, while it is
    imported, sends it what Ctrl-C sends.

    Raises:
        MachineError: it may not.
    """
    allowed = resource.getrlimit(resource.RLIMIT_NPROC)[0]
    if allowed == resource.RLIM_INFINITY or allowed >= _PLENTY:
        return
    over = Event()
    started = []
    try:
        for _ in range(os.cpu_count() or 1):
            thread = Thread(target=over.wait, daemon=True)
            thread.start()
            started.append(thread)
    except RuntimeError:
        raise MachineError(
            f"{allowed} processes and threads are allowed here, too few: allow more (ulimit -u)"
        ) from None
    finally:
        over.set()
        for thread in started:
            thread.join()


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
    if error.filename:
        return f"{error.filename}: {error.strerror}"
    if not os.access(_SHARED, os.W_OK):
        return f"{_SHARED}: cannot be written ({error.strerror}): processes need it to work together"
    if error.errno in (errno.EFBIG, errno.ENOSPC, errno.EDQUOT):
        return f"{error.strerror}: make room on the disk and in {_SHARED}, or allow larger files (ulimit -f)"
    return error.strerror


def _has_folder() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return False
    return True
