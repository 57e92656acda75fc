"""The ``rsc-swarm`` command line. Each command (rsc_swarm.cli.commands) imports what it needs when it runs."""

import gc
import os
import sys
import threading
from contextlib import suppress

from protocols.errors import ExitCode, SwarmError
from rsc_swarm.machine.leaving import all_is_done, leave_at_once

_IMPORTED = 100_000  # objects


def main() -> None:
    """The ``rsc-swarm`` command: whatever goes wrong is one line on stderr and an exit code."""
    leave_at_once()  # before anything is imported that takes time
    _import_unsearched()
    from rsc_swarm.machine.streams import stand_by_streams

    stand_by_streams()
    code = _carry_out(sys.argv[1:] or ["--help"])
    all_is_done()
    others = [thread for thread in threading.enumerate() if thread is not threading.main_thread()]
    if code == ExitCode.INTERRUPTED or any(not thread.daemon for thread in others):
        # Python would wait for a thread of somebody's policy; and libraries that were stopped in the middle may end it otherwise.
        with suppress(SwarmError):
            sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def _import_unsearched() -> None:
    """What is imported stays; to look through it for garbage, again and again, takes a tenth of a start. The first look comes
    after as many objects as the largest command imports, and from then on it is as usual: a command may run for days."""
    usual = gc.get_threshold()

    def looked(phase: str, _: dict[str, int]) -> None:
        if phase == "stop":
            gc.callbacks.remove(looked)
            gc.set_threshold(*usual)

    gc.callbacks.append(looked)
    gc.set_threshold(_IMPORTED)


def _carry_out(words: list[str]) -> int:
    """Do what the command line says; how it ended."""
    try:
        from rsc_swarm.cli.commands import loaded

        # Raises where the folder is gone: every path would be blamed for it.
        if strange := [word for word in (os.getcwd(), *words) if not _is_text(word)]:
            raise NoTextError(
                f"{strange[0]}: is no text in UTF-8, as which reports are written; give another name"
            )
        code = loaded(words[0])(words, prog_name="rsc-swarm", standalone_mode=False)
        sys.stdout.flush()
        if code == ExitCode.INTERRUPTED and not isinstance(code, ExitCode):
            raise KeyboardInterrupt  # no command has caught it, and what reads options makes a bare number of it
    except KeyboardInterrupt:
        print("rsc-swarm: stopped", file=sys.stderr)
        return ExitCode.INTERRUPTED
    except Exception as error:
        if os.environ.get("RSC_SWARM_TRACEBACK"):
            raise
        from protocols.printable import one_line
        from rsc_swarm.errors import line_of

        code, text = _explain(error)
        print(line_of(error, one_line(text)), file=sys.stderr)
    return code if isinstance(code, int) else ExitCode.SUCCEEDED


class NoTextError(SwarmError):
    """A name is not text."""


def _is_text(word: str) -> bool:
    """Whether it can be written down: a file's name may be any bytes."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


def _explain(error: Exception) -> tuple[ExitCode, str]:
    """Exit code and what is said of an error."""
    if isinstance(error, SwarmError):
        return error.exit_code, str(error)
    if hasattr(error, "format_message"):  # the option parser's
        text = error.format_message()
        return ExitCode.BAD_USAGE, f"{text[:1].lower()}{text[1:]}"
    from rsc_swarm.machine.limits import lacking

    if lack := lacking(error):
        return ExitCode.BROKEN, lack
    from rsc_swarm.foreign import foreign_library

    if hidden := foreign_library():
        return ExitCode.BAD_USAGE, hidden
    said = f"{type(error).__name__}: {error}"[:160]
    return ExitCode.BROKEN, f"unexpected {said} (set RSC_SWARM_TRACEBACK=1 to see where)"


if __name__ == "__main__":
    main()
