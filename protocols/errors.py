"""What is told to the user in one line: the base of all errors, and the exit codes of the ``rsc-swarm`` command."""

from enum import IntEnum
from typing import ClassVar

from protocols.printable import one_line


class ExitCode(IntEnum):
    """How the command ends."""

    SUCCEEDED = 0  # the flight too
    FAILED = 1  # the flight was flown to its end, without success
    BAD_USAGE = 2  # what was asked for cannot be done
    BROKEN = 3  # the run itself broke, not the flight
    INTERRUPTED = 130  # by Ctrl-C


class SwarmError(Exception):
    """One line says what is wrong, where, and what would be right; the command prints it and ends with ``exit_code``."""

    exit_code: ClassVar[ExitCode] = ExitCode.BAD_USAGE

    def __str__(self) -> str:
        """One line, whatever the names and files hold that it tells of."""
        return one_line(super().__str__())


class BrokenError(SwarmError):
    """Not what was asked for is at fault, but the run or the machine."""

    exit_code = ExitCode.BROKEN
