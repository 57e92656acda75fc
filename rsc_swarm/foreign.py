"""Foreign modules that hide the project's other packages, or a library: a folder with an ``agent.py`` or ``yaml.py``, say, on
the search path.

Their names are plain words, so it happens; and what Python says about it names neither file.
"""

import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path

_HOME = Path(__file__).resolve().parents[1]
_PACKAGES = ("protocols", "agent", "world")


def foreign_module() -> str | None:
    """One line about the first package of ours that another module hides; None if all are ours."""
    for name in _PACKAGES:
        try:
            spec = find_spec(name)
        except ValueError:  # a module without a spec, made by hand
            spec = None
        places = [Path(place) for place in (spec and spec.submodule_search_locations) or []]
        if not any(place.resolve().parent == _HOME for place in places):
            found = (spec and spec.origin) or (places and places[0]) or "nothing"
            return (
                f"import {name} finds {found} instead of {_HOME / name}: rename it, "
                "or start from another folder, without it on PYTHONPATH"
            )
    return None


def foreign_library() -> str | None:
    """One line about the first loaded module that hides a library's or Python's own; None if there is none.

    This takes a moment: it is for when something has gone wrong.
    """
    from importlib.metadata import packages_distributions

    homes = {
        Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib", "purelib", "platlib")
    }
    ours = {"rsc_swarm", *_PACKAGES}
    for name in sorted({*packages_distributions(), *sys.stdlib_module_names} - ours):
        file = getattr(sys.modules.get(name), "__file__", None)
        if file and not homes.intersection(Path(file).resolve().parents):
            return f"import {name} finds {file} instead of the library {name}: rename it, or take its folder off PYTHONPATH"
    return None
