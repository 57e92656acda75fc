"""A radio host in a process of its own, as `rsc-swarm radio` starts it."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from protocols.wire.vehicles import host_endpoint
from rsc_swarm.machine.priority import go_first
from tests.fakes.udp import free_ports

ROOT = Path(__file__).parents[2]
_FIRST_PORT = int(host_endpoint(0).rpartition(":")[2])


def free_dongle() -> int:
    """The number of a dongle whose host has this machine's port to itself, whatever else is flown on it."""
    return free_ports(1)[0] - _FIRST_PORT


@contextmanager
def hosting(port: int, dongle: int, **limits: float) -> Iterator[subprocess.Popen[bytes]]:
    """For one Crazyflie, as drone 0, at a UDP port of this machine."""
    charge = {"drone": 0, "uri": f"udp://127.0.0.1:{port}", "limits": limits}
    settings = {"swarm": "rsc", "endpoint": host_endpoint(dongle), "charges": [charge]}
    command = [sys.executable, "-m", "rsc_swarm.radiohost", json.dumps(settings)]
    with subprocess.Popen(command, cwd=ROOT, preexec_fn=go_first) as host:
        try:
            yield host
        finally:
            host.kill()
