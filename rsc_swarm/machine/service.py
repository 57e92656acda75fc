"""What a service manager is told (systemd's sd_notify(3)), if one started this process and listens."""

import math
import os
import socket
import time
from contextlib import suppress


class Service:
    """This process, as the service manager sees it. Without one nothing happens."""

    def __init__(self) -> None:
        """``WATCHDOG_USEC`` is the longest time between two signs of life (sd_watchdog_enabled(3)); these come twice as often."""
        self._address = os.environ.get("NOTIFY_SOCKET", "")
        limit, whose = os.environ.get("WATCHDOG_USEC", ""), os.environ.get("WATCHDOG_PID", "")
        ours = limit.isdecimal() and int(limit) > 0 and whose in ("", str(os.getpid()))
        self._every_s = int(limit) / 2e6 if ours else math.inf
        self._due = time.monotonic() if ours else math.inf

    def ready(self, status: str) -> None:
        """The process does from now on what it is for; ``status`` says what that is."""
        self._tell(f"READY=1\nSTATUS={status}")

    def alive(self, leaving: bool) -> bool:
        """To be called by the loop that does the work, not by a thread that would go on without it. Gives ``leaving`` back."""
        if (now := time.monotonic()) >= self._due:
            self._due = now + self._every_s
            self._tell("STOPPING=1" if leaving else "WATCHDOG=1")
        return leaving

    def _tell(self, text: str) -> None:
        if not self._address:
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.connect(self._address.replace("@", "\0", 1) if self._address[0] == "@" else self._address)
            manager.send(text.encode(), socket.MSG_DONTWAIT)  # a manager that does not listen holds up nobody
