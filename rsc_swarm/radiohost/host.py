"""The radio host: one process per Crazyradio, between the drones' processes and their Crazyflies."""

import queue
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial, reduce
from operator import or_
from pathlib import Path
from typing import Any

import zenoh

from protocols.closing import Closing
from protocols.keeper import STREAM_S, Keeper, Limits
from protocols.wire import vehicles
from protocols.wire.keys import LinkError
from protocols.wire.transport import COMMON, filled, leave
from protocols.wire.vehicles import Account, Ill, Mode, Order, Vector, VehicleMessageError
from rsc_swarm.radiohost.line import Line, init_drivers
from rsc_swarm.radiohost.warden import Warden

_SILENT_S = 0.25  # a vehicle of which nothing is heard for so long has no link
_UNSURE_S = 0.05
_ACCOUNT_S = 0.05  # what it said last is told again, older, when it says nothing new
_LEAVING_S = 30.0
_LOOK_S = 0.05


@dataclass(frozen=True)
class Charge:
    """A Crazyflie that is in this host's care: the drone that it is the vehicle of, and its cflib address.

    position_key: on which the source of positions tells where it is; None: nobody does.
    """

    drone: int
    uri: str
    limits: Limits
    position_key: str | None = None


class Care:
    """A charge, its line and its keeper; and where its drone hears of it.

    It has a thread of its own: cflib waits for a vehicle that is out of reach, and nobody else is to wait with it.
    """

    def __init__(self, charge: Charge, publisher: zenoh.Publisher, cache: Path | None) -> None:
        self.charge, self._publisher = charge, publisher
        self.keeper = Keeper(charge.limits)
        self.line = Line(charge.uri, self.give_account, cache)
        self.heard: queue.SimpleQueue[Order | Vector] = queue.SimpleQueue()  # orders, and where it is
        self._told_at, self._complaint = 0.0, ""
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def flies(self) -> bool:
        return self.keeper.mode not in (Mode.GROUND, Mode.DEAD)

    def begin(self) -> None:
        self._thread.start()

    def end(self) -> None:
        """No order is heard any more; who is told nothing lands."""
        self._leaving.set()

    def join(self, deadline: float) -> None:
        """Wait until it stands, at the latest until ``deadline``."""
        self._thread.join(max(0.0, deadline - time.monotonic()))

    def _run(self) -> None:
        due = time.monotonic()
        while self.flies or not self._leaving.is_set():
            with suppress(queue.Empty):
                self._take(self.heard.get(timeout=max(0.0, due - time.monotonic())))
            now = time.monotonic()
            if now >= due:
                due = max(due + STREAM_S, now)
                self._act()
                self.line.reopen()
                if now - self._told_at > _ACCOUNT_S:
                    self._try(self.give_account)

    def _take(self, heard: Order | Vector) -> None:
        if not isinstance(heard, Order):
            self._try(lambda: self.line.fix(heard))
        elif not self._leaving.is_set():
            self.keeper.hear(heard, time.monotonic())
            self._act()

    def _act(self) -> None:
        seen = self.line.seen
        if seen is not None:
            for act in self.keeper.act(seen, time.monotonic()):
                self._try(partial(self.line.do, act))

    def _try(self, do: Callable[[], None]) -> None:
        """Whatever goes wrong in cflib, who flies is not left alone: the next setpoint is said all the same."""
        try:
            do()
        except Exception as error:
            if (told := f"{self.charge.uri}: {type(error).__name__}: {error}") != self._complaint:
                self._complaint = told
                print(f"radio host: {told}", file=sys.stderr, flush=True)

    def give_account(self) -> None:
        """Tell its drone how it is."""
        seen, keeper = self.line.seen, self.keeper
        if seen is None:
            return
        self._told_at = now = time.monotonic()
        silent_s = now - seen.at
        age_s = now - self.line.sure_at  # a position that it makes up without measuring is none
        ills = {
            Ill.NO_LINK: silent_s > _SILENT_S,
            Ill.NO_POSITION: age_s > silent_s + _UNSURE_S,
            Ill.LOCKED: seen.locked,
            Ill.TURNED_OVER: self.line.tumbled,
            Ill.REFUSES: self.line.refuses,
        }
        account = Account(
            mode=keeper.mode,
            followed=max(0, keeper.followed),
            armed=keeper.armed and seen.armed,
            ill=reduce(or_, (ill for ill, is_so in ills.items() if is_so), Ill(0)),
            p=seen.p,
            v=seen.v,
            yaw=seen.yaw,
            tilt=seen.tilt,
            age_s=age_s,
            battery=seen.battery,
        )
        self._publisher.put(vehicles.pack_account(account))


class RadioHost(Closing):
    """Listens at ``endpoint`` for the drones of ``swarm``, and keeps its charges; at ``positions`` somebody tells where they are.

    Raises:
        protocols.wire.keys.LinkError: it cannot listen there.
    """

    def __init__(
        self,
        swarm: str,
        endpoint: str,
        charges: Sequence[Charge],
        cache: Path | None = None,
        positions: str | None = None,
    ) -> None:
        self._session = _listen(endpoint)
        self._cares = {
            charge.drone: Care(
                charge, self._publisher(vehicles.account_key(swarm, charge.drone, charge.uri)), cache
            )
            for charge in charges
        }
        self._warden = Warden()
        self._flying: dict[str, float] = {}
        self._source = _look_for(positions) if positions else None
        for care in self._cares.values():
            drone, place = care.charge.drone, partial(self._place, care)
            self._session.declare_subscriber(
                vehicles.order_key(swarm, drone, care.charge.uri), partial(self._hear, care)
            )
            self._session.declare_subscriber(vehicles.fix_key(swarm, drone), place)
            if self._source and care.charge.position_key:
                self._source.declare_subscriber(care.charge.position_key, place)

    def open(self, timeout_s: float = 60.0) -> None:
        """Reach all charges.

        Raises:
            rsc_swarm.radiohost.line.LineError: one is not there, within ``timeout_s``.
        """
        init_drivers()
        self._each(lambda line: line.open(timeout_s))

    def _each(self, do: Callable[[Line], None]) -> None:
        """With all lines at once."""
        with ThreadPoolExecutor(max_workers=max(1, len(self._cares))) as pool:
            for one in [pool.submit(do, care.line) for care in self._cares.values()]:
                one.result()

    def run(self, leaving: Callable[[], bool]) -> None:
        """Keep them until asked to leave; then bring down who flies."""
        cares = self._cares.values()
        for care in cares:
            care.begin()
        while not leaving():
            self._tell_warden()
            time.sleep(_LOOK_S)
        for care in cares:
            care.end()
        deadline = time.monotonic() + _LEAVING_S
        for care in cares:
            care.join(deadline)
        self._tell_warden()

    def _tell_warden(self) -> None:
        """Who flies, and how long it would take down."""
        flying = {}
        for care in self._cares.values():
            if care.flies and (seen := care.line.seen):
                flying[care.charge.uri] = max(1.0, round(seen.p[2] / care.charge.limits.sink_mps))
        if flying != self._flying:
            self._flying = flying
            self._warden.tell(flying)

    def _publisher(self, key: str) -> zenoh.Publisher:
        return self._session.declare_publisher(
            key,
            express=True,
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.BEST_EFFORT,
        )

    @staticmethod
    def _hear(care: Care, sample: zenoh.Sample) -> None:
        with suppress(VehicleMessageError):
            care.heard.put(vehicles.unpack_order(sample.payload.to_bytes()))

    @staticmethod
    def _place(care: Care, sample: zenoh.Sample) -> None:
        with suppress(VehicleMessageError):
            care.heard.put(vehicles.unpack_fix(sample.payload.to_bytes()))

    def close(self) -> None:
        self._each(Line.close)
        self._warden.dismiss()
        for session in filter(None, (self._session, self._source)):
            leave(session)


def _look_for(endpoint: str) -> zenoh.Session:
    """A session that finds who is there, now or later."""
    settings: dict[str, Any] = {
        "mode": "peer", "listen/endpoints": [], "connect/endpoints": [endpoint], "connect/timeout_ms": -1,
        "connect/exit_on_failure": False, "scouting/multicast/enabled": False, "scouting/gossip/enabled": False,
        "connect/retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 1.5},
    }  # fmt: skip
    try:
        return zenoh.open(filled(zenoh.Config(), settings))
    except zenoh.ZError as error:
        raise LinkError(f"positions: cannot look for {endpoint}; it reads tcp/127.0.0.1:7447, say") from error


def _listen(endpoint: str) -> zenoh.Session:
    settings: dict[str, Any] = {"mode": "router", "listen/endpoints": [endpoint], **COMMON}
    try:
        return zenoh.open(filled(zenoh.Config(), settings))
    except zenoh.ZError as error:
        raise LinkError(
            f"cannot listen at {endpoint}: is a radio host running there already? It reads tcp/127.0.0.1:7470, say"
        ) from error
