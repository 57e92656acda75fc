"""Every error a user can meet is of one family, and knows how the command ends."""

import importlib
import importlib.util
import pkgutil

import pytest

import agent
import protocols
import rsc_swarm
import world
from protocols.errors import BrokenError, ExitCode, SwarmError

# Verdicts on what came over the air or was asked of a pure rule: their callers answer them, no user meets them.
_INTERNAL = {
    "AccountError",
    "BeaconError",
    "IllegalSwap",
    "MessageError",
    "NatureError",
    "OperatorError",
    "VehicleMessageError",
    "_Breaks",
}
_OF_TESTS = {"Broke"}  # what pytest shows
_INTERRUPTED = {"PolicyStuck"}  # known of only because somebody asked to leave
_OURS = ("protocols", "agent", "world", "rsc_swarm")


def errors() -> list[type[Exception]]:
    found = set()
    for package in (protocols, agent, world, rsc_swarm):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if module.name.startswith("rsc_swarm.radiohost.") and not importlib.util.find_spec("cflib"):
                continue
            if module.name.endswith("__main__") or module.name.startswith("rsc_swarm.training."):
                continue
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, type) and issubclass(value, Exception):
                    found.add(value)
    return sorted((error for error in found if error.__module__.split(".")[0] in _OURS), key=str)


@pytest.mark.parametrize("error", errors(), ids=lambda error: error.__name__)
def test_an_error_has_an_exit_code(error: type[Exception]) -> None:
    if error.__name__ in _INTERNAL | _OF_TESTS:
        return
    assert issubclass(error, SwarmError)
    if error.__name__ in _INTERRUPTED:
        assert error.exit_code is ExitCode.INTERRUPTED
        return
    assert error.exit_code is (ExitCode.BROKEN if issubclass(error, BrokenError) else ExitCode.BAD_USAGE)


@pytest.mark.parametrize("error", [SwarmError, BrokenError, *SwarmError.__subclasses__()])
def test_an_error_is_one_line_that_a_terminal_can_show(error: type[SwarmError]) -> None:
    assert str(error("a\n b.yaml: \x1b[2J is\0 no file")) == r"a b.yaml: \x1b[2J is\x00 no file"
