"""Six fake vehicles where the example room has them, behind the client libraries of their makers."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, NamedTuple

import yaml

from tests.fakes.motion import Motion
from tests.fakes.udp import Wires, free_ports
from tests.scenarios.fleets import EXAMPLES

STARTS = [drone["start_m"] for drone in yaml.safe_load((EXAMPLES / "room.yaml").read_text())["drones"]]


class Vehicles(NamedTuple):
    """drones: as the fleet file has them. motions: where they are in truth; hold the lock of ``wires`` to look at all at once."""

    drones: list[dict[str, Any]]
    wires: Wires
    motions: list[Motion]


@contextmanager
def crazyflies() -> Iterator[Vehicles]:
    """Led by cflib, in two radio hosts."""
    from tests.fakes.crazyflie import FakeCrazyflie

    fakes = [FakeCrazyflie((x, y, 0.0)) for x, y in STARTS]
    with Wires(fakes) as wires:
        hosts = [f"tcp/127.0.0.1:{port}" for port in free_ports(2)]
        drones = [
            {
                "number": number,
                "body": f"crazyflie:udp://127.0.0.1:{port}",
                "dongle": number // 3,
                "options": {"host": hosts[number // 3]},
                "start_m": start,
            }
            for number, (port, start) in enumerate(zip(wires.ports, STARTS, strict=True))
        ]
        yield Vehicles(drones, wires, [fake.motion for fake in fakes])


@contextmanager
def autopilots() -> Iterator[Vehicles]:
    """Led by pymavlink, PX4 and ArduPilot by turns."""
    from tests.fakes.autopilot import FakeAutopilot, Make

    makes = [Make.PX4, Make.ARDUPILOT] * 3
    fakes = [FakeAutopilot(make, (x, y, 0.0)) for make, (x, y) in zip(makes, STARTS, strict=True)]
    ports = free_ports(6)
    with Wires(fakes, towards=ports) as wires:
        drones = [
            {"number": number, "body": f"mavlink:udpin:127.0.0.1:{port}", "start_m": start}
            for number, (port, start) in enumerate(zip(ports, STARTS, strict=True))
        ]
        yield Vehicles(drones, wires, [fake.motion for fake in fakes])


KINDS: dict[str, Callable[[], AbstractContextManager[Vehicles]]] = {
    "crazyflie": crazyflies,
    "mavlink": autopilots,
}
