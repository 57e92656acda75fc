"""Where what a command makes goes, besides the terminal: ``--json`` and other files."""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TextIO

from protocols.mission.document import MissionError
from protocols.whole_file import is_no_file, keep_all, write_whole


def check_place(option: str, file: Path) -> None:
    """Refuse a file that could not be written, before anything is flown.

    Raises:
        MissionError: it is none in a directory that exists.
    """
    try:
        is_no_file(file)
        there = not file.is_dir() and file.absolute().parent.is_dir()
    except OSError:  # links in a circle, a name that is too long
        there = False
    if not there:
        raise MissionError(f"{option} {file}: give a file in a directory that exists")


class JsonOutput:
    """A checked ``--json``: a file, ``-`` for stdout, or none."""

    def __init__(self, given: str | None) -> None:
        """Refuse one that could not be written, before anything is flown.

        Raises:
            MissionError: as `check_place`.
        """
        self._to_stdout = given == "-"
        self._file = None if given in (None, "-") else Path(given)
        if self._file:
            check_place("--json", self._file)

    @property
    def beside(self) -> TextIO:
        """Where text for people goes: not to stdout if the JSON does."""
        return sys.stderr if self._to_stdout else sys.stdout

    def journal(self, code: str) -> Path | None:
        """Where what is flown under this fingerprint is kept meanwhile: beside the file, if it is one and no pipe or device."""
        from rsc_swarm.study.finished import journal_path

        return journal_path(self._file, code) if self._file and not is_no_file(self._file) else None

    def write(self, text: str) -> None:
        """Write the JSON ``text`` where it was asked for.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        if self._to_stdout:
            print(text)
        elif self._file:
            write_whole(self._file, text + "\n")

    def tell(self, tell: Callable[[], object], text: str) -> None:
        """Let ``tell`` print for people, and write the JSON ``text``; neither takes the other along.

        Raises:
            protocols.whole_file.WriteError: one of them cannot be written, or neither.
        """
        keep_all(tell, self.beside.flush, partial(self.write, text))
