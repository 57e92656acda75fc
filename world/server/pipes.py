"""No pipe that nobody reads stops the world.

Writing into a socket waits while its pipe is full, and Zenoh knows no limit for that. A drone is sent no more than it has shown
to have read (world.server.peer); but a login may open several links, read one of them and leave the others to fill. So a thread
looks on: where one send does not end, the fullest pipe is cut, and the send ends.
"""

import fcntl
import os
import socket
import stat
import struct
import termios
import threading

# Where so many looks find the same send, it does not end. A process that is stopped does not look.
LOOK_S, LOOKS = 0.5, 8
_FULL_BYTES = 50_000  # a pipe with less in it is not what a send waits for


class Lookout:
    """Looks on while it is open. ``sending``: the number of the send that is under way, else None."""

    def __init__(self) -> None:
        self.sending: int | None = None
        self._over = threading.Event()
        threading.Thread(target=self._look, daemon=True).start()

    def close(self) -> None:
        """Look no more."""
        self._over.set()

    def _look(self) -> None:
        last: int | None = None
        seen = 0
        while not self._over.wait(LOOK_S):
            now = self.sending
            seen = seen + 1 if now is not None and now == last else 0
            last = now
            if seen >= LOOKS:
                seen = 0
                cut_fullest_pipe()


def cut_fullest_pipe() -> None:
    """Shut down that stream socket of this process in which most waits to be sent."""
    fullest, most = None, _FULL_BYTES
    for name in os.listdir("/proc/self/fd"):
        try:
            if stat.S_ISSOCK(os.fstat(int(name)).st_mode) and (waits := _unsent(int(name))) > most:
                fullest, most = int(name), waits
        except OSError:
            continue  # closed meanwhile
    if fullest is not None:
        with socket.socket(fileno=os.dup(fullest)) as pipe:
            if pipe.type == socket.SOCK_STREAM:
                # Cut in both directions, Zenoh closes a TLS link twice at once and now and then waits ten seconds for itself;
                # cut in one, a Unix socket wakes nobody.
                pipe.shutdown(socket.SHUT_RDWR if pipe.family == socket.AF_UNIX else socket.SHUT_WR)


def _unsent(descriptor: int) -> int:
    """Bytes that wait in a socket."""
    (waits,) = struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, bytes(4)))
    return int(waits)
