"""What brings Crazyflies down when their radio host is gone: killed, or crashed.

A process of its own, started by the host, that has cflib ready and waits. The host says who flies; when its end of the pipe
closes without a farewell, the warden takes the dongle and lands them, within the 2 s after which they would cut their motors.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress

_TIMES, _BETWEEN_S, _LONGEST_S = 5, 0.2, 10.0
_FAREWELL = "farewell"


class Warden:
    """The host's end."""

    def __init__(self) -> None:
        # A session of its own: what ends the host with all that was started from its terminal is to spare this one.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "rsc_swarm.radiohost.warden"],
            stdin=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def tell(self, flying: Mapping[str, float]) -> None:
        """Who flies now, by address, and how many seconds it takes to bring it down."""
        self._say(json.dumps(dict(flying)))

    def dismiss(self) -> None:
        """It is not needed any more."""
        self._say(_FAREWELL)
        self._process.communicate()

    def _say(self, line: str) -> None:
        assert self._process.stdin
        with suppress(OSError):
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()


def who_flies(lines: Iterable[str]) -> dict[str, float]:
    """Who has to be brought down after all that the host said; nobody after a farewell."""
    flying: dict[str, float] = {}
    for line in lines:
        if line.strip() == _FAREWELL:
            return {}
        with suppress(ValueError):  # cut off with the host
            flying = json.loads(line)
    return flying


def bring_down(flying: Mapping[str, float]) -> None:
    """Land them, each in a thread of its own: who is out of reach holds up nobody.

    No table of contents is asked for: there is no time.
    """
    threads = [threading.Thread(target=_bring_down, args=one, daemon=True) for one in flying.items()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(_LONGEST_S)


def _bring_down(uri: str, duration_s: float) -> None:
    import cflib.crtp
    from cflib.crazyflie import Crazyflie

    from rsc_swarm.radiohost.line import land

    cf = Crazyflie(link=cflib.crtp.get_link_driver(uri, lambda _: None, lambda _: None))
    for _ in range(_TIMES):
        land(cf, duration_s)
        time.sleep(_BETWEEN_S)


def main() -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    from rsc_swarm.radiohost.line import init_drivers

    init_drivers()
    bring_down(who_flies(sys.stdin))
    os._exit(0)  # threads of cflib would hold it up


if __name__ == "__main__":
    main()
