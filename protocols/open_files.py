"""How many files and sockets this process may have open: sockets that cannot be opened look like a world that does not answer."""

import os
import resource

from protocols.errors import BrokenError


class TooFewFilesError(BrokenError):
    """The limit is too low; one line says what it must be."""


def allow_open_files(needed: int) -> None:
    """See to it that this process may open ``needed`` more files than it has, as far as it may raise its limit itself.

    Raises:
        TooFewFilesError: it may not.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = len(os.listdir("/proc/self/fd")) + needed
    if soft != resource.RLIM_INFINITY and soft < wanted:
        if hard != resource.RLIM_INFINITY and hard < wanted:
            raise TooFewFilesError(
                f"this process may have {hard} files open and needs {wanted}: raise the limit (ulimit -n {wanted}, or "
                f"LimitNOFILE={wanted} in a systemd unit)"
            )
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
