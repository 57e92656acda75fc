"""A process that must act 100 times a second goes before those that need not, where it may; one of many on a machine does not."""

import os
from contextlib import suppress

_PRIORITY = 10


def go_first() -> None:
    """From now on this process, and the threads that it starts, are not kept waiting by ordinary ones (SCHED_RR).

    It may if it is root's, or where the limit ``rtprio`` allows it; else nothing changes. It must not be busy all the time.
    """
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_PRIORITY))


def give_way() -> None:
    """From now on this process pushes no other off a core when it wakes up (SCHED_BATCH).

    It is one of many that work in bursts, for a world that they must not keep waiting.
    """
    with suppress(OSError):  # not everywhere allowed
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
