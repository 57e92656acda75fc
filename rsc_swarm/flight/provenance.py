"""With what a flight was flown: enough to tell later whether it can be flown again."""

import hashlib
import os
import platform
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

_ROOT = Path(__file__).resolve().parents[2]
_GIT_S = 10.0


class Provenance(BaseModel):
    """The code and the versions that decide a flight besides its mission."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: str = Field(description="of rsc-swarm")
    commit: str | None = Field(
        description="of the checkout; ends in -dirty if files differed from it; null if it was no checkout"
    )
    python: str = Field(description="version")
    numpy: str = Field(description="version")
    numba: str = Field(description="version")
    onnxruntime: str = Field(description="version")
    policy_files: dict[str, str] = Field(
        description="SHA-256 of each file besides the project's code that decided what the policy did, by its name: "
        "its model, or its code; in a folder beside that, by the path from there"
    )


def provenance(policy_files: Sequence[Path]) -> Provenance:
    """With what would be flown here and now; ``policy_files`` are those of agent.policy.files_of."""
    return Provenance(
        **{name.replace("-", "_"): _version(name) for name in ("numpy", "numba", "onnxruntime")},
        version=_version("rsc-swarm"),
        commit=commit(),
        python=platform.python_version(),
        policy_files={_name(file, policy_files[0]): _sha256(file) for file in policy_files},
    )


def _name(file: Path, first: Path) -> str:
    folder = first.absolute().parent
    return str(file.absolute().relative_to(folder)) if file.absolute().is_relative_to(folder) else file.name


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def ask_ahead() -> None:
    """Let git look for what `commit` tells, while other things are done."""
    for words in (_WHICH, _CHANGED):
        _asked(words)


@cache
def commit() -> str | None:
    """The commit of the checkout this code runs from, with ``-dirty`` if its files differ; None if it is no checkout."""
    ask_ahead()
    which, changed = _git(_WHICH), _git(_CHANGED)
    top, _, head = (which or "").partition("\n")
    if not head or Path(top) != _ROOT:
        return None
    return f"{head}-dirty" if changed or changed is None else head


_WHICH = ("rev-parse", "--show-toplevel", "HEAD")
_CHANGED = ("status", "--porcelain", "--untracked-files=no")


@cache
def _asked(words: tuple[str, ...]) -> "subprocess.Popen[str] | None":
    """Git, as it looks at the checkout; None if there is no git."""
    elsewhere = ("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE")  # set inside hooks
    with suppress(OSError):
        return subprocess.Popen(
            ["git", "-C", str(_ROOT), "--no-optional-locks", *words],
            env={name: value for name, value in os.environ.items() if name not in elsewhere},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
    return None


def _git(words: tuple[str, ...]) -> str | None:
    """What git says about the checkout; None if it says no, or there is none."""
    if (git := _asked(words)) is None:
        return None
    try:
        said, _ = git.communicate(timeout=_GIT_S)
    except subprocess.TimeoutExpired:
        git.kill()
        git.communicate()
        return None
    return said.strip() if git.returncode == 0 else None
