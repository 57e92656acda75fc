"""Who was refused at the world's door, and why: Zenoh tells nobody but its log, and that goes to stdout.

While the door is watched, what Zenoh writes goes to a pipe and is told in plain words, each once; this process goes on writing
where it wrote before. What is told names reasons, not drones: who was refused did not show who it is.
"""

import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import zenoh

_LEVELS = (
    "off,zenoh_link_tls=warn,zenoh_link_commons=warn,zenoh_transport::unicast::establishment::accept=debug"
)
_OTHER_KEYS = (
    "its keys were not made together with this world's; give both what one run of 'rsc-swarm keys' made"
)
_REASONS = (
    (
        r"invalid peer certificate: certificate (has )?expired",
        "its certificate has expired; make new keys, or compare the clocks",
    ),
    (
        r"invalid peer certificate: certificate not valid yet",
        "its certificate is not valid yet; compare the clocks",
    ),
    (r"invalid peer certificate: .*extended key usage", "its certificate is not that of a drone"),
    (r"invalid peer certificate", _OTHER_KEYS),
    (r"sent no certificates?", "it shows no certificate"),
    (
        r"alert: \w*Expired",
        "it takes this world's certificate for expired or not yet valid; compare the clocks",
    ),
    (r"alert: BadCertificate", "this world's certificate is not for the address at which it was called"),
    (r"alert: (UnknownCA|DecryptError|CertificateUnknown)", _OTHER_KEYS),
    (r"corrupt message", "it does not speak TLS"),
    (r"Invalid (password|user)\b", "its password is not that of its name in these keys"),
    (r"Too many open files", "this process may not open more files; raise the limit (ulimit -n)"),
)


def reason(line: str) -> str | None:
    """Why somebody was refused, from a line of Zenoh's log; None if it tells of no such thing."""
    for pattern, plain in _REASONS:
        if re.search(pattern, line):
            return plain
    return None


@contextmanager
def door_watched(say: Callable[[str], None]) -> Iterator[None]:
    """Within the block ``say`` is told, from a thread of its own, why somebody was refused; each reason once.

    Once in a process: Zenoh begins its log only once.
    """
    read, write = os.pipe()
    os.set_blocking(write, False)  # rather lose a line than hold up the world
    sys.stdout.flush()
    before, stdout = os.dup(1), sys.stdout
    os.dup2(write, 1)
    os.close(write)
    sys.stdout = os.fdopen(os.dup(before), "w", buffering=1)
    zenoh.init_log_from_env_or(_LEVELS)
    listening = threading.Thread(target=_listen, args=(read, say), daemon=True)
    listening.start()
    try:
        yield
    finally:
        sys.stdout.close()
        sys.stdout = stdout
        os.dup2(before, 1)  # closes the pipe, which ends the thread
        os.close(before)
        listening.join()


def _listen(pipe: int, say: Callable[[str], None]) -> None:
    told: set[str] = set()
    with open(pipe, errors="replace") as lines:
        for line in lines:
            why = reason(line)
            if why and why not in told:
                told.add(why)
                say(f"somebody was refused at the door: {why}")
