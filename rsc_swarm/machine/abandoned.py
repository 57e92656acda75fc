"""Folders that a process makes for itself. One whose processes were all killed outright goes with the next of its kind.

As long as any process of a run lives it holds a lock on the folder.
"""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_RANDOM = "?" * 8  # what mkdtemp makes of a name
_YOUNG_S = 60.0  # one that is younger may be about to be locked


def make_folder(prefix: str, base: Path) -> tuple[Path, int]:
    """A private folder in ``base``, and the descriptor that holds it. Children inherit that by fork, and the lock with it."""
    for rubbish in _abandoned(base, prefix):
        shutil.rmtree(rubbish, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=base))
    held = os.open(folder, os.O_RDONLY)
    with suppress(OSError):  # not every file system locks folders; there none is held, and none removed
        fcntl.flock(held, fcntl.LOCK_EX)
    return folder, held


def hold(folder: Path) -> int:
    """Keep a folder to this process and those forked from it, until the descriptor is closed that this returns.

    Raises:
        BlockingIOError: another process holds it. OSError: it cannot be opened, or its file system locks no folders.
    """
    held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(held)
        raise
    return held


def _abandoned(base: Path, prefix: str) -> Iterator[Path]:
    for folder in base.glob(prefix + _RANDOM):
        try:
            if time.time() - folder.stat().st_mtime < _YOUNG_S:
                continue
            held = hold(folder)
        except OSError:
            continue  # in use, another user's, or just being removed
        try:
            yield folder
        finally:
            os.close(held)
