"""Processes by their numbers, as /proc tells of them.

Who lives in a container that has no /proc of its own sees that of the machine there, in which its numbers are those of strangers.
"""

import os
import time
from contextlib import suppress

import psutil

# Place of the start, in clock ticks since the machine was started, among what comes after a process's name.
_STARTED = 19


def process(pid: int) -> psutil.Process:
    """The process of this number, as we count.

    Raises:
        psutil.NoSuchProcess: there is none, or /proc does not tell of ours.
    """
    if _my_number() != os.getpid():
        raise psutil.NoSuchProcess(pid)
    return psutil.Process(pid)


def born_at() -> float:
    """When this process was started [s since 1970]."""
    return time.time() - age_s()


def age_s() -> float:
    """How long ago that is [s]. psutil knows only to a second when the machine was started, from which /proc counts."""
    said = _told("self/stat").rpartition(b")")[2].split()
    return time.clock_gettime(time.CLOCK_BOOTTIME) - int(said[_STARTED]) / os.sysconf("SC_CLK_TCK")


def anonymous_bytes(pid: int) -> int:
    """The memory it took for itself, in use, of no file [bytes]: who else maps the same libraries makes no difference to it.

    Raises:
        psutil.NoSuchProcess: there is none, or it is ending.
    """
    with suppress(OSError):
        for line in _told(f"{pid}/status").splitlines():
            if line.startswith(b"RssAnon:"):
                return int(line.split()[1]) * 1024
    raise psutil.NoSuchProcess(pid)


def _told(name: str) -> bytes:
    """What this file of /proc says.

    Leaves nothing behind in who asks: the parts of a Path are entered in Python's table of names, which outgrows its place after
    some ten thousand, and of each file of text a name stays in Python's cache of attributes.
    """
    with open(f"/proc/{name}", "rb") as file:
        return file.read()


def _my_number() -> int:
    """Our own number, as /proc counts."""
    return int(os.readlink("/proc/self"))
