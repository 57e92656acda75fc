"""The ``rsc-swarm`` command line. Every command has a file of its own and imports what it needs when it runs."""

import os
import sys

from protocols.errors import ExitCode, SwarmError
from rsc_swarm.cli import (  # noqa: F401  each adds its command, in the order of the help
    agent,
    bench,
    evaluate,
    keys,
    launch,
    mission,
    plot,
    schema,
    simulate,
    tables,
    train,
    world,
)  # isort: skip
from rsc_swarm.cli.app import app


def main() -> None:
    """The ``rsc-swarm`` command: whatever goes wrong is one line on stderr and an exit code."""
    try:
        code = app(sys.argv[1:] or ["--help"], prog_name="rsc-swarm", standalone_mode=False)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except Exception as error:
        if os.environ.get("RSC_SWARM_TRACEBACK"):
            raise
        code, text = _explain(error)
        print(f"rsc-swarm: {text}", file=sys.stderr)
    sys.exit(code if isinstance(code, int) else ExitCode.SUCCEEDED)


def _explain(error: Exception) -> tuple[ExitCode, str]:
    """Exit code and one line for an error."""
    if hasattr(error, "format_message"):  # the option parser's
        text = " ".join(error.format_message().split())
        return ExitCode.BAD_USAGE, f"{text[:1].lower()}{text[1:]}"
    text = " ".join(str(error).split())
    if isinstance(error, SwarmError):
        return error.exit_code, text
    kind = type(error).__name__
    return ExitCode.BROKEN, f"unexpected {kind}: {text[:160]} (set RSC_SWARM_TRACEBACK=1 to see where)"


if __name__ == "__main__":
    main()
