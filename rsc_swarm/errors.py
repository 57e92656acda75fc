"""Errors on their way from a command to the program that runs it: a line on stderr, which then also names their kind."""

import os
from collections.abc import Iterator

from protocols.errors import BrokenError, ExitCode, SwarmError

NAMED = {"RSC_SWARM_NAME_ERRORS": "1"}  # in the environment of a command that is to name the kind
_SPEAKER = "rsc-swarm: "


def line_of(error: Exception, text: str) -> str:
    """What a command says of ``error`` when it ends, ``text`` being what is wrong."""
    named = all(os.environ.get(name) == value for name, value in NAMED.items())
    return f"{_SPEAKER}{type(error).__name__ + ': ' if named else ''}{text}"


def error_of(said: str, code: int) -> SwarmError:
    """The error with which a command ended that has `NAMED` in its environment; ``said``: on stderr, ``code``: its exit code."""
    lines = said.strip().splitlines() or [f"the command ended with exit code {code}"]
    line = lines[-1].removeprefix(_SPEAKER)
    name, _, text = line.partition(": ")
    kinds = {kind.__name__: kind for kind in _kinds(SwarmError)}
    if name in kinds:
        return kinds[name](text)
    return SwarmError(line) if code == ExitCode.BAD_USAGE else BrokenError(line)


def _kinds(base: type[SwarmError]) -> Iterator[type[SwarmError]]:
    yield base
    for kind in base.__subclasses__():
        yield from _kinds(kind)
