"""How soon Crazyflies behind a radio host do what when something is gone: the table of docs/hardware.md.

python -m tests.radiohost.faults

A fake for each, the real cflib, a radio host in a process of its own with the limits as they come. Times of the wall clock: a
busy machine makes them longer.
"""

import math
import queue
import time
from collections.abc import Callable
from contextlib import ExitStack

import zenoh

from agent.air.vehicle import Mode, Rig, Setpoint, make_vehicle
from protocols.keeper import Limits
from protocols.wire.vehicles import Account, account_key, host_endpoint, unpack_account
from tests.fakes.crazyflie import FakeCrazyflie, Stage
from tests.fakes.udp import Wires
from tests.radiohost.hosting import free_dongle, hosting

_DONGLE = free_dongle()
_SINKS_MPS = 0.1
_PATIENCE_S = 30.0


class Flight(ExitStack):
    """A Crazyflie that is led along a line, and who listens to what its host says of it."""

    def __init__(self) -> None:
        super().__init__()
        self.fake = FakeCrazyflie()
        wires = self.enter_context(Wires([self.fake]))
        limits = Limits()
        self.host = self.enter_context(
            hosting(wires.ports[0], _DONGLE, hold_s=limits.hold_s, land_s=limits.land_s)
        )
        rig, uri = Rig(0, self.fake.motion.p, 1.0, 3.0, dongle=_DONGLE), f"udp://127.0.0.1:{wires.ports[0]}"
        self.vehicle = make_vehicle(f"crazyflie:{uri}", rig)
        self.vehicle.open(30.0)
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["{host_endpoint(_DONGLE)}"]')
        self._told: queue.SimpleQueue[tuple[float, Account]] = queue.SimpleQueue()
        listener = self.enter_context(zenoh.open(config))
        listener.declare_subscriber(account_key("rsc", 0, uri), self._hear)
        self.vehicle.arm()
        self._until(lambda: self.vehicle.state().armed)
        self.vehicle.take_off(0.8)
        self._until(lambda: self.vehicle.state().mode is Mode.HOLD)
        for step in range(150):
            x = 0.005 * step
            self.vehicle.fly(Setpoint((x, 0.0, 0.8), (0.5, 0.0, 0.0), (0.0, 0.0, 0.0)))
            self.vehicle.state()
            time.sleep(0.01)
        self.since = time.monotonic()

    def _hear(self, sample: zenoh.Sample) -> None:
        self._told.put((time.monotonic(), unpack_account(sample.payload.to_bytes())))

    @staticmethod
    def _until(so: Callable[[], bool]) -> None:
        deadline = time.monotonic() + _PATIENCE_S
        while not so() and time.monotonic() < deadline:
            time.sleep(0.005)

    def when(self, so: Callable[[], bool]) -> float:
        """Seconds from the fault until that is so; infinite: never."""
        self._until(so)
        return time.monotonic() - self.since if so() else math.inf

    def when_mode(self, mode: Mode) -> float:
        """Seconds from the fault until its host leads it so."""
        while True:
            at, account = self._told.get(timeout=_PATIENCE_S)
            if at >= self.since and account.mode is mode:
                return at - self.since

    def sinks(self) -> bool:
        return self.fake.motion.v[2] < -_SINKS_MPS


def process_killed() -> str:
    with Flight() as flight:  # from now on it says nothing, as who is dead
        hold, land = flight.when_mode(Mode.HOLD), flight.when_mode(Mode.LAND)
        down = flight.when(lambda: not flight.fake.motors_on)
        return f"its drone's process is killed | holds after {hold:.2f} s, lands after {land:.2f} s | {down:.1f} | {_how(flight)}"


def host_killed() -> str:
    with Flight() as flight:
        flight.host.kill()
        sinks, down = flight.when(flight.sinks), flight.when(lambda: not flight.fake.motors_on)
        return f"its radio host is killed | its warden lands it: it sinks after {sinks:.2f} s | {down:.1f} | {_how(flight)}"


def link_dead() -> str:
    with Flight() as flight:
        flight.fake.dead_link = True
        known = flight.when(lambda: bool(flight.vehicle.state().health))
        falls = flight.when(lambda: flight.fake.stage is Stage.LOCKED)
        return (
            f"its dongle is unplugged | its drone knows after {known:.2f} s; the firmware cuts its motors after {falls:.2f} s "
            f"| {flight.when(lambda: flight.fake.motion.p[2] <= 0.0):.1f} | {_how(flight)}"
        )


def _how(flight: Flight) -> str:
    fell = flight.fake.motion.fell
    return f"falls, at {fell:.1f} m/s" if fell else "lands"


if __name__ == "__main__":
    print("| what is gone | what happens | down after s | how |")
    print("| --- | --- | --- | --- |")
    for story in (process_killed, host_killed, link_dead):
        print(f"| {story()} |", flush=True)
