"""Asking a policy, and naming it where it goes wrong: which policy, what it raised, and at which line of its file."""

import inspect
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from agent.policy.base import Policy, PolicyError, Seen

_LONGEST = 200  # characters of what was raised
_FLOAT64 = np.dtype(np.float64)
_HERE = Path(__file__).parent
_NOT_THEIRS = ("<frozen ", *(str(_HERE / name) for name in ("asking.py", "registry.py", "policy_file.py")))
T = TypeVar("T")


def ask(policy: Policy, name: str, seen: Seen) -> NDArray[np.float64]:
    """What the policy called ``name`` wants: accelerations (A, 2) m/s^2, in an array of its own.

    Raises:
        PolicyError: it raised, or returned something else.
    """
    wanted = call(policy.act, name, seen)
    if (
        not isinstance(wanted, np.ndarray)
        or wanted.dtype != _FLOAT64
        or wanted.shape != seen.slot_error.shape
    ):
        raise PolicyError(
            f"policy {name}: act must return {seen.slot_error.shape} float64, not {_kind_of(wanted)}"
        )
    return np.array(wanted, order="C")


def call(method: Callable[..., T], name: str, *arguments: object) -> T:
    """Call a ``method`` of the policy called ``name``.

    Raises:
        PolicyError: it raised.
    """
    try:
        return method(*arguments)
    except Exception as error:
        raise raised(name, error, source_of(getattr(method, "__self__", None))) from error


def raised(name: str, error: Exception, source: str | None = None) -> PolicyError:
    """One line for what the policy called ``name``, whose file is ``source``, raised."""
    if isinstance(error, PolicyError):
        return error
    text = " ".join(str(error.msg if isinstance(error, SyntaxError) else error).split())
    text = f": {text[:_LONGEST]}" if text else ""
    return PolicyError(f"policy {name} raised {type(error).__name__}{text}{_place(error, source)}")


def source_of(policy: object) -> str | None:
    """The file that defines a policy's class, if it has one."""
    try:
        return inspect.getsourcefile(type(policy))
    except (TypeError, OSError):
        return None


def _place(error: Exception, source: str | None) -> str:
    """`` at homing.py:14 (act)``: the innermost line in the policy's own file, else in any that is not ours."""
    if isinstance(error, SyntaxError) and error.filename:
        return f" at {_shown(error.filename)}:{error.lineno}"
    frames = [(frame.f_code, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    theirs = [at for at in frames if not at[0].co_filename.startswith(_NOT_THEIRS)]
    own = [at for at in theirs if at[0].co_filename == source] or theirs
    if not own:
        return ""
    code, line = own[-1]
    function = "" if code.co_name.startswith("<") else f" ({code.co_name})"
    return f" at {_shown(code.co_filename)}:{line}{function}"


def _shown(file: str) -> str:
    """A file as one would write it here."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file


def _kind_of(value: object) -> str:
    """What a policy returned, for the error that tells what it should have been."""
    return f"{value.shape} {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
