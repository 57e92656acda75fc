"""Asking a policy, and naming it where it goes wrong: which policy, what it raised, and at which line of its file."""

import inspect
import os
import re
import signal
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from agent.policy.base import Policy, PolicyError, Seen
from agent.policy.policy_file import PREFIX
from protocols.dynamics import ABSURD_MPS2

_LONGEST = 200  # characters of what was raised
_FLOAT64 = np.dtype(np.float64)
_HERE = Path(__file__).parent
_NOT_THEIRS = (
    "<frozen ",
    *(str(_HERE / name) for name in ("asking.py", "base.py", "registry.py", "policy_file.py")),
)
_PRIVATE = re.compile(rf"{PREFIX}[0-9a-f]+\.?")
T = TypeVar("T")


def ask(policy: Policy, name: str, seen: Seen, rows: int) -> NDArray[np.float64]:
    """What the policy called ``name`` wants of A = ``rows`` drones: accelerations (A, 2) m/s^2, in an array of its own.

    Raises:
        PolicyError: it raised, or returned something else.
    """
    wanted = call(policy.act, name, seen)
    seen.close()
    if not isinstance(wanted, np.ndarray) or wanted.dtype != _FLOAT64 or wanted.shape != (rows, 2):
        raise PolicyError(
            f"policy {name}: act must return {(rows, 2)} float64, not {_kind_of(wanted)}{_defined(policy.act)}"
        )
    return np.array(wanted, order="C")


def absurd(policy: Policy, name: str, agent: int, wanted: NDArray[np.float64]) -> PolicyError:
    """One line for a policy that wants of drone ``agent`` what is no acceleration: ``wanted`` (2,) m/s^2."""
    x, y = wanted.tolist()
    return PolicyError(
        f"policy {name}: act wants ({x:g}, {y:g}) m/s² of agent {agent}; "
        f"give finite numbers of at most {ABSURD_MPS2:g}{_defined(policy.act)}"
    )


def call(method: Callable[..., T], name: str, *arguments: object) -> T:
    """Call a ``method`` of the policy called ``name``. A process that it forks and that comes back here as well ends here.

    Raises:
        PolicyError: it raised, be it what is meant to end a process. KeyboardInterrupt: Ctrl-C, where nobody else waits for it.
    """
    caller = os.getpid()
    try:
        return method(*arguments)
    except BaseException as error:
        if (
            isinstance(error, KeyboardInterrupt)
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        ):
            raise
        raise raised(name, error, method) from error
    finally:
        if os.getpid() != caller:
            os._exit(0)


def raised(name: str, error: BaseException, asked: object = None) -> PolicyError:
    """One line for what the policy called ``name`` raised when this class or method of it was ``asked``."""
    if isinstance(error, PolicyError):
        return error
    place = _place(error, asked)
    text = f": {said}" if (said := _said(error)) else ""
    return PolicyError(f"policy {name} raised {type(error).__name__}{text}{place}")


def source_of(kind: object) -> str | None:
    """The file that defines a class or a method, if there is one."""
    try:
        return inspect.getsourcefile(kind)  # type: ignore[arg-type]
    except (TypeError, OSError):
        return None


def _said(error: BaseException) -> str:
    try:
        text = str(error.msg if isinstance(error, SyntaxError) else error)
    except Exception:  # its own __str__ is wrong
        return ""
    return _PRIVATE.sub("", " ".join(text.split()))[:_LONGEST]


def _place(error: BaseException, asked: object) -> str:
    """`` at homing.py:14 (act)``: the innermost line in the policy's own file, else in any that is not ours, else where what was
    asked is defined."""
    if isinstance(error, SyntaxError) and error.filename:
        return f" at {at(error.filename, error.lineno or 0)}"
    source = source_of(type(asked.__self__) if inspect.ismethod(asked) else asked)
    frames = [(frame.f_code, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    theirs = [at for at in frames if not at[0].co_filename.startswith(_NOT_THEIRS)]
    own = [at for at in theirs if at[0].co_filename == source] or theirs
    if not own:
        return _defined(asked)
    code, line = own[-1]
    return f" at {at(code.co_filename, line, code.co_name)}"


def _defined(asked: object) -> str:
    """`` at homing.py:7 (act)``: where a method, or a class's way to be made, is defined, if that can be told."""
    function: Any = asked.__init__ if isinstance(asked, type) else asked  # type: ignore[misc]
    code = getattr(function, "__code__", None)
    if code:
        return f" at {at(code.co_filename, code.co_firstlineno, code.co_name)}"
    source = source_of(asked)
    return f" at {_shown(source)}" if source else ""


def at(file: str, line: int, function: str = "<module>") -> str:
    """``homing.py:14 (act)``."""
    return f"{_shown(file)}:{line}{'' if function.startswith('<') else f' ({function})'}"


def _shown(file: str) -> str:
    """A file as one would write it here."""
    path = Path(file)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else file


def _kind_of(value: object) -> str:
    """What a policy returned, for the error that tells what it should have been."""
    if isinstance(value, np.ndarray):
        return f"{value.shape} {value.dtype}"
    module = type(value).__module__.partition(".")[0]
    return type(value).__name__ if module == "builtins" else f"{module}.{type(value).__name__}"
