"""How an autopilot is led, PX4 or ArduPilot: what is said to it and in which order, without input or output.

- PX4 is led in OFFBOARD. It enters that, and arms in it, only while setpoints come, and when they have come for a second; it is
  led up and down by setpoints too.
- ArduPilot (Copter) is led in GUIDED, armed there, and leaves the ground only by NAV_TAKEOFF.
- Both land in their own LAND mode, and stop their motors in flight only by force.
- Who leaves the mode in which it is led without being told to is led by a pilot or by its own failsafe: nothing more is said to
  it, but to cut its motors.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from agent.air.vehicle import Failsafe, Rig, Vector
from protocols.keeper import STREAM_S, Arm, Cut, Keeper, Land, Limits, Seen, Stream, TakeOff
from protocols.wire.vehicles import Mode

_CLIMB_MPS, _SINK_MPS = 0.5, 0.3
_BELOW_M = 1.0
_PATIENCE_S = 15.0  # motors take seconds to spin up, and each autopilot climbs and sinks at its own pace
_STILL: Vector = (0.0, 0.0, 0.0)


class Wanted(NamedTuple):
    """A parameter of an autopilot: at least, at most; why, in words."""

    name: str
    least: float
    most: float
    why: str


@dataclass(frozen=True)
class Profile:
    """An autopilot.

    Attributes:
        number: in its heartbeat (MAV_AUTOPILOT). led, land: its custom modes. streams_first_s: how long setpoints have to come
        before it is led. climbs: by a command, not by setpoints. integers_as_bytes: how it sends those of its parameters.
        stations_matter: its failsafe hears heartbeats of ground stations. estimate: number of the message in which its estimator
        says what it knows. wanted: what has to be set for its failsafe to be one.
    """

    name: str
    number: int
    led: int
    land: int
    streams_first_s: float
    climbs: bool
    integers_as_bytes: bool
    stations_matter: bool
    estimate: int
    wanted: tuple[Wanted, ...]

    def mode_numbers(self, custom_mode: int) -> tuple[int, ...]:
        """As MAV_CMD_DO_SET_MODE wants them: PX4 has main modes and sub modes."""
        return (custom_mode,) if self.climbs else (custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)


PX4 = Profile(
    "px4", 12, 6 << 16, 4 << 16 | 6 << 24, 1.2, False, True, False, 230,
    (
        Wanted("COM_OF_LOSS_T", 0.0, 1.0, "so many seconds after the last setpoint its failsafe acts"),
        Wanted("COM_OBL_RC_ACT", 4, 4, "it lands when setpoints stop"),
    ),
)  # fmt: skip
ARDUPILOT = Profile(
    "ardupilot", 3, 4, 9, 0.0, True, False, True, 193,
    (
        Wanted("GUID_TIMEOUT", 0.1, 0.5, "so many seconds after the last setpoint it stops"),
        Wanted("FS_GCS_ENABLE", 5, 5, "it lands when this computer falls silent"),
        Wanted("FS_GCS_TIMEOUT", 2, 2, "so many seconds after that"),
    ),
)  # fmt: skip
PROFILES = {profile.name: profile for profile in (PX4, ARDUPILOT)}


class SetMode(NamedTuple):
    """Go into this custom mode."""

    custom_mode: int


class SetArmed(NamedTuple):
    """Arm or disarm; by force even in the air."""

    on: bool
    force: bool = False


class Climb(NamedTuple):
    """Take off to a height [m]."""

    height: float


Say = SetMode | SetArmed | Climb | Stream


class Leader:
    """Leads one autopilot.

    Attributes:
        keeper: what decides what it is to do. taken: whether somebody else leads it.
    """

    def __init__(self, profile: Profile, rig: Rig) -> None:
        self.profile, self.taken = profile, False
        self.keeper = Keeper(_limits(rig.failsafe, rig.acceleration_mps2))
        self._led = False
        # From where, what, since when, looking where.
        self._ramp: tuple[Vector, TakeOff, float, float] | None = None
        self._streaming_since = math.inf
        self._streamed_at = self._said_at = -math.inf

    def say(self, seen: Seen, custom_mode: int, now: float) -> list[Say]:
        """What is said to it now; ask 50 to 100 times a second."""
        keeper, profile = self.keeper, self.profile
        acts = keeper.act(seen, now)
        self._look_who_leads(custom_mode)
        said: list[Say] = []
        for act in acts:
            match act:
                case Arm(on):
                    said += self._arm(on, custom_mode, now)
                case TakeOff() if profile.climbs:
                    said.append(Climb(act.height))
                case TakeOff():
                    self._ramp = self._ramp or (seen.p, act, now, seen.yaw)
                case Stream():
                    said.append(act)
                case Land():
                    pass  # said as long as it does not, below
                case Cut():
                    return [SetArmed(False, force=True)]
        if keeper.mode is Mode.LAND and custom_mode != profile.land and seen.armed and self._due(now):
            said.append(SetMode(profile.land))
        said += self._own_setpoints(seen, now)
        if any(isinstance(one, Stream) for one in said):
            self._streaming_since = min(self._streaming_since, now)
        return [] if self.taken else said

    def _look_who_leads(self, custom_mode: int) -> None:
        profile, mode = self.profile, self.keeper.mode
        if mode in (Mode.GROUND, Mode.DEAD):
            self._led = self.taken = False
        elif mode is Mode.LAND:
            self.taken = self.taken or (self._led and custom_mode not in (profile.led, profile.land))
        else:
            self._led = self._led or custom_mode == profile.led
            self.taken = self.taken or (self._led and custom_mode != profile.led)

    def _arm(self, on: bool, custom_mode: int, now: float) -> list[Say]:
        if not on or custom_mode == self.profile.led:
            return [SetArmed(on)]
        streams = now - self._streaming_since >= self.profile.streams_first_s
        return [SetMode(self.profile.led)] if streams or self.profile.climbs else []

    def _due(self, now: float) -> bool:
        if now - self._said_at < 0.5:
            return False
        self._said_at = now
        return True

    def _own_setpoints(self, seen: Seen, now: float) -> list[Say]:
        """What an autopilot is told that climbs by setpoints, and arms only where they come."""
        mode = self.keeper.mode
        self._ramp = self._ramp if mode is Mode.CLIMB else None
        waits = mode is Mode.GROUND and self.keeper.armed and self.profile.streams_first_s > 0.0
        if not waits and mode is Mode.GROUND:
            self._streaming_since = math.inf
        if not (waits or self._ramp) or now - self._streamed_at < STREAM_S - 0.001:
            return []
        self._streamed_at = now
        if self._ramp:
            (x, y, z), (height, duration_s), since, yaw = self._ramp
            part = min(1.0, (now - since) / duration_s)
            speed = (height - z) / duration_s if part < 1.0 else 0.0
            return [Stream((x, y, z + part * (height - z)), (0.0, 0.0, speed), _STILL, yaw)]
        # Below the ground: PX4 leaves it as soon as a setpoint is above where it takes itself to be, which wanders.
        return [Stream((*seen.p[:2], seen.p[2] - _BELOW_M), _STILL, _STILL, seen.yaw)]


def _limits(failsafe: Failsafe, acceleration_mps2: float) -> Limits:
    return Limits(
        hold_s=failsafe.hold_s,
        land_s=failsafe.land_s,
        climb_mps=_CLIMB_MPS,
        sink_mps=_SINK_MPS,
        braking_mps2=0.5 * acceleration_mps2,
        patience_s=_PATIENCE_S,
    )
