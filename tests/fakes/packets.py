"""What a client says to a Crazyflie, byte by byte."""

import struct

from tests.fakes.motion import STILL, Vector

NOTIFY_STOP = b"\x71\0" + struct.pack("<I", 0)
NO_THRUST = b"\x30" + struct.pack("<fffH", 0.0, 0.0, 0.0, 0)
ARM, DISARM, EMERGENCY_STOP = b"\x91\1\1", b"\x91\1\0", b"\x91\3"
STOP_PLAN = b"\x80\3\0"


def setpoint(p: Vector, v: Vector = STILL, a: Vector = STILL) -> bytes:
    """Full state, looking along x."""
    numbers = [round(1000 * number) for number in (*p, *v, *a)]
    return b"\x70\6" + struct.pack("<hhhhhhhhhIhhh", *numbers, 3 << 30, 0, 0, 0)


def take_off(height: float, duration_s: float) -> bytes:
    return b"\x80\7" + struct.pack("<Bff?f", 0, height, 0.0, True, duration_s)


def land(duration_s: float) -> bytes:
    return b"\x80\x08" + struct.pack("<Bff?f", 0, 0.0, 0.0, True, duration_s)
