"""``--json``: where the figures of a command go, besides the terminal."""

import sys
from pathlib import Path
from typing import TextIO

from protocols.mission.document import MissionError
from protocols.whole_file import write_whole


class JsonOutput:
    """A checked ``--json``: a file, ``-`` for stdout, or none."""

    def __init__(self, given: str | None) -> None:
        """Refuse one that could not be written, before anything is flown.

        Raises:
            MissionError: it names no file in a directory that exists.
        """
        self._to_stdout = given == "-"
        self.file = None if given in (None, "-") else Path(given)
        if self.file is None:
            return
        absolute = self.file.absolute()
        if absolute.is_dir() or not absolute.parent.is_dir():
            raise MissionError(f"--json {given}: give a file in a directory that exists, or - for stdout")

    @property
    def beside(self) -> TextIO:
        """Where text for people goes: not to stdout if the JSON does."""
        return sys.stderr if self._to_stdout else sys.stdout

    def write(self, text: str) -> None:
        """Write the JSON ``text`` where it was asked for.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        if self._to_stdout:
            print(text)
        elif self.file:
            write_whole(self.file, text + "\n")
