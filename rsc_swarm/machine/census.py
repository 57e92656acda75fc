"""Processes by their numbers, as /proc tells of them.

Who lives in a container that has no /proc of its own sees that of the machine there, in which its numbers are those of strangers.
"""

import os
import time

import psutil


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
    return psutil.Process(_my_number()).create_time()


def age_s() -> float:
    """How long ago that is [s]."""
    return time.time() - born_at()


def _my_number() -> int:
    """Our own number, as /proc counts."""
    return int(os.readlink("/proc/self"))
