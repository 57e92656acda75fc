"""The private folder of a run, in which the world's socket lives.

- Only its owner may enter it. It lies under ``$XDG_RUNTIME_DIR``, else in the folder for temporary files.
- The launcher removes it. If the launcher has died, the world does. If both were killed outright, a later
  launch does (rsc_swarm.machine.abandoned).
"""

import os
import shutil
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Self

from rsc_swarm.machine.abandoned import make_folder

_PREFIX = "rsc-swarm-run-"
_LONGEST_SOCKET_PATH = 100  # the kernel takes 107 bytes, and Zenoh puts a lock file beside the socket


def remove_run_folder(path: Path) -> None:
    """Remove the folder and what is in it; fine if it is gone already."""
    shutil.rmtree(path, ignore_errors=True)


class RunFolder:
    """A fresh private folder, gone when its ``with`` block ends.

    Attributes:
        path: the folder.
        socket: where the world's socket goes.
        endpoint: the same as a Zenoh endpoint.
    """

    def __init__(self) -> None:
        self.path, self._held = make_folder(_PREFIX, _base())
        self.socket = self.path / "world.sock"
        self.endpoint = f"unixsock-stream/{self.socket}"

    def remove(self) -> None:
        remove_run_folder(self.path)
        if self._held >= 0:
            os.close(self._held)
            self._held = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.remove()


def _base() -> Path:
    """The first usable place whose path leaves room for a socket's name."""
    places = (os.environ.get("XDG_RUNTIME_DIR"), tempfile.gettempdir(), "/tmp")
    for place in places:
        if not place or not os.access(place, os.W_OK | os.X_OK):
            continue
        fits = len(os.fsencode(place)) + len(f"/{_PREFIX}12345678/world.sock") <= _LONGEST_SOCKET_PATH
        if fits and _is_plain(place):
            return Path(place)
    raise OSError(
        f"no folder for the socket of the run: none of {', '.join(place for place in places if place)} "
        "is writable, short enough and without ?, # or bytes that are no text; set XDG_RUNTIME_DIR to a short path"
    )


def _is_plain(place: str) -> bool:
    """Whether it can stand in the address of an endpoint."""
    return not set(place) & set("?#") and place.isprintable()
