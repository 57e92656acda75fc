"""A process that must act 100 times a second goes before those that need not, where it may."""

import os
from contextlib import suppress

_PRIORITY = 10


def go_first() -> None:
    """From now on this process, and the threads that it starts, are not kept waiting by ordinary ones (SCHED_RR).

    It may if it is root's, or where the limit ``rtprio`` allows it; else nothing changes. It must not be busy all the time.
    """
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_PRIORITY))
