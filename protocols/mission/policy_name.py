"""The forms in which a mission names its policy, as far as they name files.

A policy is ``rsc-h20`` or another short name, ``package.module:Class``, ``path/to/homing.py:Homing``, or ``path/to/model.onnx``.
A relative path counts from the folder of the mission file that names it, else from the current folder.
"""

from pathlib import Path

MODEL_ENDING = ".onnx"
_CODE_ENDING = ".py"
PAPERS_EXPERT = "paper-expert"
EXPERTS = ("expert", PAPERS_EXPERT)  # one mind that sees all drones: none of them can fly it


def split(policy: str) -> tuple[str, str]:
    """``(place, class)``: place is a file, a module or a short name; class is empty where none is named."""
    place, colon, name = policy.rpartition(":")
    return (place, name) if colon else (name, "")


def file_of(policy: str) -> str | None:
    """The file in a policy's name; None if it is known by a short name or as a module."""
    place, name = split(policy)
    if not name and place.endswith(MODEL_ENDING):
        return place
    return place if place.endswith(_CODE_ENDING) else None


def named_by(policy: str, file: Path | str) -> str:
    """The same policy, its file being ``file``."""
    name = split(policy)[1]
    return f"{file}:{name}" if name else str(file)


def from_folder(policy: str, folder: Path) -> str:
    """The same policy, a relative path in it taken from ``folder``."""
    file = file_of(policy)
    return policy if file is None else named_by(policy, folder / file)
