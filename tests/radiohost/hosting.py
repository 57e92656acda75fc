"""A radio host in a process of its own, as `rsc-swarm radio` starts it."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from protocols.wire.vehicles import host_endpoint

ROOT = Path(__file__).parents[2]


@contextmanager
def hosting(port: int, dongle: int, **limits: float) -> Iterator[subprocess.Popen[bytes]]:
    """For one Crazyflie, as drone 0, at a UDP port of this machine."""
    charge = {"drone": 0, "uri": f"udp://127.0.0.1:{port}", "limits": limits}
    settings = {"swarm": "rsc", "endpoint": host_endpoint(dongle), "charges": [charge]}
    with subprocess.Popen(
        [sys.executable, "-m", "rsc_swarm.radiohost", json.dumps(settings)], cwd=ROOT
    ) as host:
        try:
            yield host
        finally:
            host.kill()
