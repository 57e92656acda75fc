"""``python -m rsc_swarm.radiohost SETTINGS``: a radio host, until it is asked to leave; then it brings down who flies.

SETTINGS is one JSON object, as `rsc-swarm radio` writes it:

    {"swarm": "rsc", "endpoint": "tcp/127.0.0.1:7470", "cache": "/home/me/.cache/rsc-swarm/crazyflie",
     "charges": [{"drone": 0, "uri": "radio://0/80/2M/E7E7E7E701", "limits": {"land_s": 1.0}}]}

It says on stderr when it is ready, and in one line what is wrong. Exit codes: 0, 2 wrong settings, 3 a Crazyflie or cflib is
not there, 130 asked to leave before it was ready.
"""

import os
import signal
import sys
import threading
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from protocols.errors import ExitCode, SwarmError
from protocols.keeper import Limits

_CACHE = Path.home() / ".cache" / "rsc-swarm" / "crazyflie"


class ChargeSettings(BaseModel):
    """One Crazyflie."""

    model_config = ConfigDict(extra="forbid", strict=True)
    drone: Annotated[int, Field(ge=0, lt=250)]
    uri: str
    limits: Limits = Limits()
    position_key: str | None = None


class Settings(BaseModel):
    """All of a dongle."""

    model_config = ConfigDict(extra="forbid")
    swarm: str
    endpoint: str
    charges: Annotated[list[ChargeSettings], Field(min_length=1)]
    cache: Path = _CACHE
    positions: str | None = None


def main(text: str) -> ExitCode:
    """Be the radio host of these settings."""
    try:
        settings = Settings.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"])) or "settings"
        print(f"radiohost: {place}: {first['msg']}; rsc-swarm radio writes them", file=sys.stderr)
        return ExitCode.BAD_USAGE
    try:
        from rsc_swarm.radiohost.host import Charge, RadioHost
    except ModuleNotFoundError as error:
        print(f"radiohost: {error.name} is missing: pip install 'rsc-swarm[radio]'", file=sys.stderr)
        return ExitCode.BROKEN
    ready, leaving = threading.Event(), threading.Event()

    def leave(*_: object) -> None:
        leaving.set()
        if not ready.is_set():  # nobody flies yet, and threads of cflib wait for answers
            os._exit(ExitCode.INTERRUPTED)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, leave)
    charges = [Charge(one.drone, one.uri, one.limits, one.position_key) for one in settings.charges]
    try:
        settings.cache.mkdir(parents=True, exist_ok=True)
        with RadioHost(
            settings.swarm, settings.endpoint, charges, settings.cache, settings.positions
        ) as host:
            host.open()
            ready.set()
            print(
                f"radio host: {len(charges)} at {settings.endpoint}, ready, process {os.getpid()}",
                file=sys.stderr, flush=True,
            )  # fmt: skip
            host.run(leaving.is_set)
    except (SwarmError, OSError) as error:
        print(f"radiohost: {error}", file=sys.stderr)
        return error.exit_code if isinstance(error, SwarmError) else ExitCode.BROKEN
    return ExitCode.SUCCEEDED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) == 2 else "{}"))
