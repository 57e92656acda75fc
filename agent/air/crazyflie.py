"""``crazyflie:URI``, a Crazyflie: led through the radio host that holds its dongle (a process of its own), over Zenoh.

URI is the address that the radio host reaches it by, for example ``radio://0/80/2M/E7E7E7E701``. The option ``host`` of its drone
in the fleet file is the endpoint of its radio host; without it is that of the drone's dongle on this machine.

An order is said again with every look at the state; a setpoint is not, so that who hangs is silent.
"""

import math
import threading
import time
from contextlib import suppress
from typing import Any

import zenoh

from agent.air.orders import Ordered
from agent.air.vehicle import Rig, Setpoint, State, VehicleAddressError, VehicleError
from protocols.wire import vehicles
from protocols.wire.endpoints import checked_endpoint
from protocols.wire.keys import LinkError
from protocols.wire.transport import COMMON, filled, leave
from protocols.wire.vehicles import Account, Kind, Order, VehicleMessageError

_SAY_S = 0.015  # between two orders: 50 Hz are followed, and what is said at 100 Hz is thinned out
_TRY_S = 1.0  # to reach a radio host: who waits for one hears no signal meanwhile


class CrazyflieVehicle(Ordered):
    """As agent.air.vehicle.Vehicle has it."""

    lags = False

    def __init__(self, where: str, rig: Rig) -> None:
        """Raises VehicleAddressError: ``where`` is no address of a Crazyflie, or an option is wrong."""
        try:
            dongle = vehicles.dongle_of(where) if rig.dongle is None else rig.dongle
            self._endpoint = checked_endpoint(rig.options.get("host", vehicles.host_endpoint(dongle)))
        except (LinkError, ValueError) as error:
            raise VehicleAddressError(f"crazyflie:{where}: {error}") from None
        self._uri, self._rig, self._swarm = where, rig, rig.swarm
        self._said_at = -math.inf
        self._newest: tuple[float, Account] | None = None  # when it came, and what it says
        self._heard = threading.Event()
        self._session: zenoh.Session | None = None

    def open(self, timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        self._session = self._connect(timeout_s)
        try:
            self._listen(self._session, max(0.0, deadline - time.monotonic()))
        except BaseException:
            self.close()
            raise

    def _listen(self, session: zenoh.Session, timeout_s: float) -> None:
        session.declare_subscriber(
            vehicles.account_key(self._swarm, self._rig.drone, self._uri),
            zenoh.handlers.Callback(self._hear, indirect=False),
        )
        self._publisher = session.declare_publisher(
            vehicles.order_key(self._swarm, self._rig.drone, self._uri),
            express=True,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.BEST_EFFORT,
        )
        if not self._heard.wait(timeout_s):
            raise VehicleError(
                f"the radio host at {self._endpoint} says nothing of the Crazyflie of drone {self._rig.drone} at {self._uri}: "
                "it does not reach it (and says why); or it is that of another fleet, or has another fleet file than this drone: "
                "give each fleet a host of its own"
            )

    def _connect(self, timeout_s: float) -> zenoh.Session:
        settings: dict[str, Any] = {
            **COMMON,
            "mode": "client",
            "connect/endpoints": [self._endpoint],
            "connect/timeout_ms": round(1e3 * min(timeout_s, _TRY_S)),
            "connect/exit_on_failure": True,
            "connect/retry": {"period_init_ms": 20, "period_max_ms": 500, "period_increase_factor": 1.5},
        }
        deadline = time.monotonic() + timeout_s
        while True:
            try:
                return zenoh.open(filled(zenoh.Config(), settings))
            except zenoh.ZError as error:
                if time.monotonic() >= deadline - _TRY_S:
                    raise VehicleError(
                        f"no radio host answers at {self._endpoint} within {timeout_s:g} s: start it with 'rsc-swarm radio', or "
                        "name another under options: {host: ...}"
                    ) from error

    def _hear(self, sample: zenoh.Sample) -> None:
        with suppress(VehicleMessageError):
            self._newest = time.monotonic(), vehicles.unpack_account(sample.payload.to_bytes())
            self._heard.set()

    def state(self) -> State:
        if self._newest is None:
            raise VehicleError(f"crazyflie:{self._uri} has not been opened")
        if self._order.kind not in (Kind.NOTHING, Kind.FLY):
            self._say()
        at, account = self._newest
        return State(
            p=account.p,
            v=account.v,
            yaw=account.yaw,
            tilt=account.tilt,
            age_s=account.age_s + time.monotonic() - at,
            battery=account.battery,
            mode=account.mode,
            armed=account.armed,
            health=tuple(words for ill, words in vehicles.WORDS.items() if ill in account.ill),
        )

    def fly(self, setpoint: Setpoint) -> None:
        # The first at once: the order before, which is said again, would take its turns.
        if self._order.kind is not Kind.FLY or time.monotonic() - self._said_at >= _SAY_S:
            self._give(self._next(Kind.FLY, *setpoint))

    def close(self) -> None:
        if self._session is not None:
            leave(self._session)
            self._session = None

    def _give(self, order: Order) -> None:
        self._order = order
        self._said_at = -math.inf
        self._say()

    def _say(self) -> None:
        now = time.monotonic()
        if now - self._said_at >= _SAY_S:
            self._said_at = now
            self._publisher.put(vehicles.pack_order(self._order))
