"""One Crazyflie at the end of cflib: opened, led, and read at 100 Hz."""

import logging
import math
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crtp import radiodriver

from protocols.errors import BrokenError
from protocols.keeper import Act, Arm, Cut, Land, Seen, Stream, TakeOff
from protocols.wire.vehicles import Vector

_QUIET_S = 1.5  # over UDP cflib never resends: who waits for an answer that was lost waits for ever
_TAKES_S, _AGAIN_S = 5.0, 0.3  # so long a program that had the dongle may take to let go of it
_CONSOLE, _LINK = 0, 15  # ports that speak by themselves
_LOG_PERIOD_MS = 10
_LOST_PACKETS = 2000  # in a row, some seconds of them: then cflib gives the link up, and it is made anew
_REACH_M = 32.0  # positions travel as 16 bits of millimetres
_UINT8, _MELLINGER = 0x08, 2  # it tracks a way four to six times closer than the PID
_UNSURE = 0.1**2  # m²: an estimate whose variance is larger than this is none
_MAY_ARM, _IS_ARMED, _ARMS_ITSELF, _IS_FLYING, _IS_TUMBLED = (1 << bit for bit in (0, 1, 2, 4, 5))
_IS_LOCKED = 1 << 6 | 1 << 7  # or crashed
# All that is needed fits into the 26 bytes of one packet.
_LOGGED = {
    **{f"stateEstimateZ.{name}": "int16_t" for name in ("x", "y", "z", "vx", "vy", "vz")},
    **{f"stateEstimate.{name}": "FP16" for name in ("roll", "pitch", "yaw")},
    "kalman.varPX": "FP16",
    "kalman.varPY": "FP16",
    "supervisor.info": "uint16_t",
}
_VOLTS = "pm.vbat"  # firmware in the loop has none
_EMPTY_V, _FULL_V = 3.7, 4.1  # of its one cell at rest
_FLOWN_V, _FRESH_V = 3.0, 4.0  # with its motors on: at a fifth of the way its firmware calls it low


class LineError(BrokenError, RuntimeError):
    """A Crazyflie cannot be reached. One line."""


def init_drivers() -> None:
    """Once per process, before any line is opened."""
    logging.getLogger("cflib").setLevel(logging.CRITICAL)
    warnings.filterwarnings(
        "ignore", message=".*subsystem requires CRTP protocol"
    )  # firmware older than cflib
    radiodriver.set_retries_before_disconnect(_LOST_PACKETS)
    cflib.crtp.init_drivers()


class _Lock:
    """Which of cflib's threads sends. One that is thrown out while it sends (its link is taken away from it) never lets go of
    cflib's own lock, and then nobody sends any more: this one is waited for only so long.
    """

    _LONGEST_S = 0.3

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def acquire(self) -> None:
        self._lock.acquire(timeout=self._LONGEST_S)

    def release(self) -> None:
        with suppress(RuntimeError):
            self._lock.release()


class Line:
    """A Crazyflie.

    Attributes:
        seen: what it said last of itself; None before the first. sure_at: when it was last sure of its position [s].
        tumbled: whether it lies on its side. refuses: whether it cannot be armed for another reason.
    """

    def __init__(self, uri: str, told: Callable[[], None], cache: Path | None = None) -> None:
        """``told`` is called, in a thread of cflib, whenever it has said something. cache: a folder for its tables."""
        self.uri, self._told = uri, told
        self._cache = str(cache) if cache else None
        self._cf: Any = None
        self._refusal = ""  # why there is no dongle
        self.seen: Seen | None = None
        self.sure_at, self.tumbled, self.refuses = -math.inf, False, False

    def open(self, timeout_s: float) -> None:
        """Reach it, set its controller, and let it speak.

        Raises:
            LineError: it is not there, within ``timeout_s``, or has no such variable.
        """
        begun = time.monotonic()
        deadline = begun + timeout_s
        while not self._connect(deadline):
            if self._refusal and time.monotonic() > begun + _TAKES_S:
                raise LineError(
                    f"{self.uri} cannot be used: {self._refusal}; is the dongle in, does no other program use it, and may you? "
                    "(a udev rule for USB 1915:7777)"
                )
            if time.monotonic() > deadline:
                raise LineError(
                    f"nothing answers at {self.uri} within {timeout_s:g} s: is it switched on, is its address right, "
                    "is the dongle in?"
                )
        try:
            self._set_controller()
            log = LogConfig("rsc", _LOG_PERIOD_MS)
            for name, form in _LOGGED.items():
                log.add_variable(name, form)
            if self._cf.log.toc.get_element_by_complete_name(_VOLTS):
                log.add_variable(_VOLTS, "FP16")
            self._cf.log.add_config(log)
        except (KeyError, AttributeError) as error:
            self.close()
            raise LineError(f"{self.uri}: its firmware is too old: {error}; update it") from error
        log.data_received_cb.add_callback(lambda _, data, __: self._read(data))
        log.start()

    def _connect(self, deadline: float) -> bool:
        """Try until nothing comes any more. The first time its tables of contents take a while; the values of all its
        parameters, which cflib asks for then, nobody waits for.
        """
        there, heard_at = threading.Event(), time.monotonic()

        def hear(packet: Any) -> None:
            nonlocal heard_at
            if packet.port not in (_CONSOLE, _LINK):
                heard_at = time.monotonic()

        def refuse(_: str, why: str) -> None:
            self._refusal = why.partition("\n")[0].rpartition(": ")[2]  # a traceback follows

        self._cf = Crazyflie(rw_cache=self._cache)
        self._cf._send_lock = _Lock()
        self._cf.connected.add_callback(lambda _: there.set())
        self._cf.packet_received.add_callback(hear)
        self._cf.connection_failed.add_callback(refuse)
        self._cf.open_link(self.uri)
        if self._cf.link is None:
            time.sleep(_AGAIN_S)
            return False
        self._refusal = ""
        while time.monotonic() < min(deadline, heard_at + _QUIET_S):
            if there.wait(0.05):
                self._cf.packet_received.remove_callback(hear)
                return True
        self.close()
        return False

    def reopen(self) -> None:
        """Make a link anew that was given up (it was out of reach, or the dongle out): the vehicle goes on speaking as it did."""
        if self._cf.link is None:
            with suppress(Exception):  # whatever its drivers raise: tried again the next time
                self._cf.link = cflib.crtp.get_link_driver(self.uri, lambda _: None, self._cf._link_error_cb)

    def _set_controller(self) -> None:
        self._cf.param.set_value_raw("stabilizer.controller", _UINT8, _MELLINGER)

    def do(self, act: Act) -> None:
        """Tell it. Waits for up to 2 s while it is out of reach."""
        cf = self._cf
        match act:
            case Stream(p, v, a, yaw):
                turned = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
                # Beyond what can be said it is led to the edge of that: no setpoint may fail to be said.
                cf.commander.send_full_state_setpoint(
                    _within(p), _within(v), _within(a), turned, 0.0, 0.0, 0.0
                )
            case TakeOff(height, duration_s):
                self._set_controller()  # again: nothing says whether it was heard
                cf.high_level_commander.takeoff(height, duration_s, yaw=None)
            case Land(duration_s):
                land(cf, duration_s)
            case Arm(on):
                cf.supervisor.send_arming_request(on)
            case Cut():
                cf.supervisor.send_emergency_stop()

    def fix(self, p: Vector) -> None:
        """Tell it where it is."""
        self._cf.loc.send_extpos(p)

    def _read(self, data: dict[str, float]) -> None:
        x, y, z, vx, vy, vz = (
            data[f"stateEstimateZ.{name}"] / 1000 for name in ("x", "y", "z", "vx", "vy", "vz")
        )
        roll, pitch, yaw = (math.radians(data[f"stateEstimate.{name}"]) for name in ("roll", "pitch", "yaw"))
        bits = int(data["supervisor.info"])
        flying = bool(bits & _IS_FLYING)
        now = time.monotonic()
        if max(data["kalman.varPX"], data["kalman.varPY"]) < _UNSURE:
            self.sure_at = now
        self.tumbled = bool(bits & _IS_TUMBLED)
        self.refuses = not bits & (_MAY_ARM | _IS_ARMED | _IS_TUMBLED | _IS_LOCKED)
        self.seen = Seen(
            at=now,
            p=(x, y, z),
            v=(vx, vy, vz),
            yaw=yaw,
            tilt=math.acos(max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch)))),
            battery=charge(data.get(_VOLTS, _FULL_V), flying),
            armed=bool(bits & _IS_ARMED),
            arms_itself=bool(bits & _ARMS_ITSELF),
            flying=flying,
            locked=bool(bits & _IS_LOCKED),
        )
        self._told()

    def close(self) -> None:
        """Let go of it. cflib's own farewell is a setpoint of no thrust, which one that flies would obey: it gets none."""
        if self._cf is None:
            return
        with suppress(Exception):
            link, self._cf.link = self._cf.link, None
            if link is not None:
                link.close()
            self._cf.close_link()


def charge(volts: float, flying: bool) -> float:
    """How full its battery is, 0 to 1, by its voltage.

    Its firmware's own level (pm.batteryLevel) takes any for one at rest: in the air, where the motors pull it down by a third of
    a volt, it says 10 % of one that is nearly full.
    """
    empty, full = (_FLOWN_V, _FRESH_V) if flying else (_EMPTY_V, _FULL_V)
    return max(0.0, min(1.0, (volts - empty) / (full - empty)))


def land(cf: Any, duration_s: float) -> None:
    """Come down from wherever it is.

    The plan first, and then the word that setpoints are over: without a plan that word stops the motors.
    """
    cf.high_level_commander.land(0.0, duration_s, yaw=None)
    cf.commander.send_notify_setpoint_stop()
    cf.high_level_commander.land(0.0, duration_s, yaw=None)


def _within(vector: Vector) -> Vector:
    x, y, z = (max(-_REACH_M, min(_REACH_M, part)) for part in vector)
    return x, y, z
