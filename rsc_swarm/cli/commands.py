"""All commands. Each is a module of its own, which takes a moment to import, so only what is asked for is."""

from importlib import import_module

import typer

from rsc_swarm.cli.app import app

_MODULES = (  # in the order of the help
    "agent", "agents", "air", "bench", "campaign", "evaluate", "export", "fly_alone", "ground", "keys", "launch", "mission",
    "plot", "radio", "replay", "report", "schema", "selfcheck", "simulate", "sweep", "tables", "train", "warm_up", "world",
)  # fmt: skip


def loaded(word: str = "--help") -> typer.Typer:
    """The application with the command of this name; with all of them where no module is named after it."""
    named = word.replace("-", "_")
    for module in [named] if named in _MODULES else _MODULES:
        import_module(f"rsc_swarm.cli.{module}")
    return app
