"""How a policy is found: by a short name, an entry point, its module, its file, or its model file.

Learned ones are known by their model file: by its name if it comes with the project, else by its path.
"""

import importlib
import sys
from collections.abc import Iterator
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from agent.policy.asking import call, raised, source_of
from agent.policy.base import Policy, PolicyError
from agent.policy.model_file import SHIPPED, shipped_models
from agent.policy.policy_file import classes_in, files_with, load_file
from protocols.mission.document import Mission
from protocols.mission.policy_name import EXPERTS, MODEL_ENDING, file_of, split

ENTRY_POINTS = "rsc_swarm.policies"
_OURS = Path(__file__).parents[1]
_BUILT_IN = {
    "analytic": "agent.policy.analytic:Analytic",
    "cruise": "agent.policy.cruise:Cruise",
    "saber": "agent.policy.saber:Saber",
}


@cache
def _elsewhere() -> dict[str, str]:
    """Policies of other packages: where they are, by name. Looked for once: that reads about every package there is, and what is
    forked afterwards shares what was found.
    """
    return {point.name: point.value for point in entry_points(group=ENTRY_POINTS)}


def policy_names() -> list[str]:
    """The policies that have a short name here."""
    return sorted({*_BUILT_IN, *shipped_models(), *_elsewhere()})


def find_policy(name: str, mission: Mission) -> Policy:
    """The policy called ``name``, made for this mission.

    Raises:
        PolicyError: unknown name, or the class cannot be imported or made; the line says where it raised.
    """
    if name in shipped_models() or name.endswith(MODEL_ENDING):
        from agent.policy.learned import Learned  # loads ONNX Runtime

        return Learned(mission, SHIPPED / f"{name}{MODEL_ENDING}" if name in shipped_models() else Path(name))
    kind = _class_called(name)
    if not callable(kind):
        raise PolicyError(f"policy {name}: is a {type(kind).__name__}; name a class with a method act(seen)")
    made = call(kind, name, mission)
    if not callable(call(getattr, name, made, "act", None)):
        raise PolicyError(f"policy {name}: has no method act(seen)")
    files = call(getattr, name, made, "files", ())
    try:
        missing = [file for file in map(Path, files) if not file.is_file()]
    except TypeError:
        raise PolicyError(f"policy {name}: files must be paths of files, not {files!r}") from None
    if missing:
        raise PolicyError(f"policy {name}: files: there is no file {missing[0]}")
    return cast(Policy, made)


def _class_called(name: str) -> Any:
    address = _BUILT_IN.get(name, name)
    address = _elsewhere().get(name, address)
    place, class_name = split(address)
    file = file_of(address)
    if name in EXPERTS:
        raise PolicyError(
            f"policy {name}: sees the whole field and all drones, so no drone can fly it; rsc-swarm evaluate --policy {name} does"
        )
    if not (place and class_name) and file is None:
        known = ", ".join(policy_names())
        raise PolicyError(
            f"policy: unknown policy {name!r}; known: {known}; or give FILE.py:Class, package.module:Class or a model file"
        )
    module = _module(name, place, file)
    if class_name and hasattr(module, class_name):
        return getattr(module, class_name)
    classes = ", ".join(classes_in(module)) or "no class"
    raise PolicyError(
        f"policy {name}: {f'there is no {class_name}' if class_name else 'name the class'} in {place}; it has {classes}"
    )


def _module(name: str, place: str, file: str | None) -> ModuleType:
    try:
        return load_file(Path(file)) if file else importlib.import_module(place)
    except OSError as error:
        if error.filename is not None and file and Path(error.filename) == Path(file).absolute():
            raise PolicyError(f"policy {name}: {file} cannot be read ({error.strerror})") from None
        raise raised(name, error) from error
    except ModuleNotFoundError as error:
        if error.name and f"{place}.".startswith(f"{error.name}."):
            raise PolicyError(f"policy {name}: cannot be loaded ({error})") from None
        raise raised(name, error) from error
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise raised(name, error) from error


def _module_of(kind: type) -> ModuleType | None:
    return sys.modules.get(kind.__module__)


def files_of(policy: Policy) -> tuple[Path, ...]:
    """The files besides the project's own code that decide what ``policy`` does: its code first, then what it says it reads."""
    return tuple(dict.fromkeys(_files_of(policy)))


def _files_of(policy: Policy) -> Iterator[Path]:
    source = source_of(type(policy))
    if source and not Path(source).is_relative_to(_OURS):
        yield Path(source)
        module = _module_of(type(policy))
        if module:
            yield from files_with(module)
    yield from map(Path, getattr(policy, "files", ()))
