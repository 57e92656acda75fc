"""What the server needs of others: a link to the drones, and somebody (or nobody) who runs their processes."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from protocols.errors import BrokenError
from world.outlets.snapshot import Snapshot


class Link(Protocol):
    """Bytes to and from drones: world.server.link.WorldLink, or a test's."""

    def send(self, agent: int, payload: bytes) -> None: ...

    def offer(self, agent: int, process: int) -> bytes | None: ...

    def cast(self, agent: int, payload: bytes) -> bool: ...

    def receive(self, timeout_s: float) -> tuple[int, bytes] | None: ...

    def turned_away(self, agent: int) -> int:
        """Messages of this drone so far that were too long or too many to be taken in."""

    def bar(self, agent: int) -> None:
        """From now on nothing that this drone says is taken in."""


class Lost(NamedTuple):
    """A drone whose process has ended without the mission's doing, and how that came."""

    agent: int
    why: str


class ServerError(BrokenError, RuntimeError):
    """The run broke; one line says why."""


STRUCK_OFF = "struck off"


class Control(Protocol):
    """Whoever runs the processes: the launcher at the other end of a pipe, or nobody."""

    watches: bool
    """Whether `paused` knows."""

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        """Do this to the drones' processes: kill, freeze, thaw, restart; or end those of drones that were `STRUCK_OFF`."""

    def lost(self) -> list[Lost]:
        """Drones whose processes have ended since the last call."""

    def paused(self, agent: int) -> bool:
        """Whether this drone's process is known to be stopped (Ctrl-Z, SIGSTOP): it will go on, and is worth waiting for."""

    def gathered(self, ready: int) -> None:
        """So many drones are ready; the flight begins with the last of them."""

    def show(self, picture: Snapshot) -> None:
        """Show the flight."""

    def leaving(self) -> bool:
        """Whether to end the flight now."""


class NoControl:
    """Nobody runs the processes: each drone is on a machine of its own."""

    watches = False

    def __init__(
        self, leaving: Callable[[], bool], gathered: Callable[[int], None], show: Callable[[Snapshot], None]
    ) -> None:
        self.leaving, self.gathered, self.show = leaving, gathered, show

    def apply(self, kind: str, agents: tuple[int, ...]) -> None:
        """A fault of a process cannot be made from here; the drone is only treated as if it had happened."""

    def lost(self) -> list[Lost]:
        """Unknown from here."""
        return []

    def paused(self, agent: int) -> bool:
        """Unknown from here."""
        return False
