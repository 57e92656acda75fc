"""What decides flights, as a few digits: whether two flights can be compared, or two machines fly the same."""

import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from protocols.mission.document import Mission
from protocols.mission.policy_name import EXPERTS
from rsc_swarm.batch.expert import FILES as EXPERT_FILES
from rsc_swarm.flight.policy_facts import policy_facts

_ROOT = Path(__file__).resolve().parents[2]
_RULES = ("protocols", "agent", "world", "rsc_swarm/flight/simulate.py")
_WHOLE = ("protocols", "agent", "world", "rsc_swarm")
_MODELS = (".onnx", ".json")
_MADE = {"__pycache__", "compiled"}  # of the rest


def fingerprint(mission: Mission) -> str:
    """16 hexadecimal digits: equal only for missions that differ in nothing but seeds, and the same code.

    Raises:
        agent.policy.PolicyError: the mission's policy cannot be found or made.
    """
    fields = mission.model_dump(mode="json", exclude={"map_seed", "seed", "name"})
    digest = hashlib.blake2b(json.dumps(fields, sort_keys=True).encode(), digest_size=8)
    digest.update(code_fingerprint().encode())
    expert = mission.policy in EXPERTS
    for path in EXPERT_FILES if expert else policy_facts(mission).files:
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache  # as it was when first asked for: this process flies on with that, whatever becomes of the files
def code_fingerprint() -> str:
    """16 hexadecimal digits: equal only for the same rules, and the same versions of what computes; policies left aside."""
    files = [file for place in _RULES for file in _files(_ROOT / place) if file.suffix not in _MODELS]
    return _digest(files)


@cache
def whole_fingerprint() -> str:
    """16 hexadecimal digits: equal only where all of the project is the same, its models too."""
    return _digest([file for place in _WHOLE for file in _files(_ROOT / place)])


def name_of(*parts: object) -> str:
    """16 hexadecimal digits: equal only for the same whole project and the same parts, as they are written."""
    said = " ".join(map(str, (whole_fingerprint(), *parts)))
    return hashlib.blake2b(said.encode(), digest_size=8).hexdigest()


def _files(path: Path) -> list[Path]:
    found = sorted(path.rglob("*")) if path.is_dir() else [path]
    return [
        file for file in found if file.is_file() and not _MADE.intersection(file.relative_to(_ROOT).parts)
    ]


def _digest(files: list[Path]) -> str:
    versions = f"{version('numba')} {np.__version__} {version('onnxruntime')}"
    digest = hashlib.blake2b(versions.encode(), digest_size=8)
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()
