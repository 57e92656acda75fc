"""rsc-swarm as a library (docs/api.md)::

    import rsc_swarm as rs

    mission = rs.mission("dense", agents=36, map_seed=8)
    flight = rs.simulate(mission)
    flight.report.tau_s, flight.trajectory.positions

The names are those of `rsc_swarm.api`. They are loaded when the first of them is asked for, so that the command line, which
is a part of this package, answers ``--help`` at once.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsc_swarm.api import *  # noqa: F403
    from rsc_swarm.api import __all__ as __all__
else:

    def __getattr__(name: str) -> Any:
        from importlib import import_module

        from rsc_swarm.foreign import foreign_module

        if name == "__all__" or not name.startswith("_"):
            if found := foreign_module():
                raise ImportError(found)
            api = import_module("rsc_swarm.api")
            if name == "__all__" or name in api.__all__:
                return getattr(api, name)
        raise AttributeError(f"module 'rsc_swarm' has no attribute {name!r}")
