"""A Crazyflie's firmware in the loop: the binary, started as ``BINARY PORT ADDRESS``, with `Quadrotor` for its physics.

The binary speaks CRTP by UDP to whoever listens at that port: what it says to its motors comes on CRTP's port 9, there its
inertial sensors are told to it, and everything else is for its client. Between the two stands this, with a port for cflib.
"""

import math
import os
import select
import socket
import struct
import subprocess
import threading
import time
from contextlib import suppress
from pathlib import Path

from protocols.closing import Closing
from tests.fakes.motion import GRAVITY, Vector
from tests.firmware.quadrotor import Quadrotor

_STEP_S = 0.001
_SENSE_EVERY, _POSE_EVERY = (
    2,
    20,
)  # steps: the binary reads a packet a millisecond, and its client has to get through too
# What is told to it before it listens blocks it for ever. It says so, or else has had time enough.
_LISTENS, _BOOT_S = b"Wait for sensor calibration", 8.0
_TRIES, _CALIBRATED_S = 5, 20.0
_HELLO, _SIMULATION, _POSE = b"\xf3", 0x90, 0x61
_PER_G, _PER_DEGREE = 65536 / 32, 65536 / 4000


def in_the_loop(binary: Path, start: Vector) -> "InTheLoop":
    """One that leads its motors. Now and then a binary does not come up: then another is started."""
    for _ in range(_TRIES):
        loop = InTheLoop(binary, start)
        if loop.leads.wait(_CALIBRATED_S):
            return loop
        loop.close()
    raise RuntimeError(f"{binary} does not lead its motors; it is started as BINARY PORT ADDRESS")


class InTheLoop(Closing):
    """Attributes: port: for cflib. body: where it is in truth. leads: set when it has led its motors."""

    def __init__(self, binary: Path, start: Vector) -> None:
        self.body = Quadrotor(start)
        self._duties = (0.0, 0.0, 0.0, 0.0)
        self._firmware, self._clients = _socket(), _socket()
        self.port: int = self._clients.getsockname()[1]
        self._at: tuple[str, int] | None = None
        self._client: tuple[str, int] | None = None
        self._talks_at = math.inf
        self._over, self.leads = threading.Event(), threading.Event()
        port = self._firmware.getsockname()[1]
        self._terminal, its_end = os.openpty()  # to a file it would not say it in time
        self._process = subprocess.Popen([binary, str(port), "127.0.0.1"], stdout=its_end)
        os.close(its_end)
        self._threads = [
            threading.Thread(target=run, daemon=True) for run in (self._run, self._carry, self._read)
        ]
        for thread in self._threads:
            thread.start()

    def _run(self) -> None:
        """Physics, and what the firmware says."""
        due, step = time.monotonic(), 0
        while not self._over.is_set():
            self._hear()
            now = time.monotonic()
            if now - due > 0.1:  # the machine was busy elsewhere
                due = now
            while due <= now and not self._over.is_set():
                due += _STEP_S
                step += 1
                self.body.step(self._duties, _STEP_S)
                if now > self._talks_at and step % _SENSE_EVERY == 0:
                    self._tell(step)
            time.sleep(_STEP_S / 2)

    def _read(self) -> None:
        """What it says on its terminal."""
        said = b""
        while not self._over.is_set():
            if select.select([self._terminal], [], [], 0.2)[0]:
                with suppress(OSError):
                    said = (said + os.read(self._terminal, 4096))[-8192:]
                if _LISTENS in said:
                    self._talks_at = min(self._talks_at, time.monotonic() + 0.1)

    def _hear(self) -> None:
        while True:
            try:
                packet, self._at = self._firmware.recvfrom(64)
            except (BlockingIOError, ConnectionError):
                return
            if packet == _HELLO:
                self._firmware.sendto(_HELLO, self._at)
                self._talks_at = time.monotonic() + _BOOT_S
            elif packet[0] & 0xF3 == _SIMULATION:
                if len(packet) == 9:
                    self.leads.set()
                    self._duties = tuple(duty / 65535 for duty in struct.unpack("<HHHH", packet[1:]))  # type: ignore[assignment]
            elif self._client:
                with suppress(OSError):
                    self._clients.sendto(packet, self._client)

    def _tell(self, step: int) -> None:
        body = self.body
        sensed = [round(part / GRAVITY * _PER_G) for part in body.force]
        # A gyro without any noise is taken for one that is not there.
        sensed += [round(math.degrees(rate) * _PER_DEGREE) + step // _SENSE_EVERY % 2 for rate in body.rates]
        clipped = [max(-32768, min(32767, number)) for number in sensed]
        packets = [bytes([_SIMULATION, 0]) + struct.pack("<hhhhhh", *clipped)]
        if step % _POSE_EVERY == 0:
            w, x, y, z = body.q
            packets.append(bytes([_POSE, 8]) + struct.pack("<fffffff", *body.p, x, y, z, w))
        for packet in packets:
            with suppress(OSError):
                self._firmware.sendto(packet, self._at)  # type: ignore[arg-type]

    def _carry(self) -> None:
        """What the client says."""
        self._clients.setblocking(True)
        self._clients.settimeout(0.2)
        while not self._over.is_set():
            with suppress(OSError):
                packet, self._client = self._clients.recvfrom(64)
                if time.monotonic() > self._talks_at and self._at:
                    self._firmware.sendto(packet, self._at)

    def close(self) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()
        self._process.kill()
        self._process.wait()
        os.close(self._terminal)
        self._firmware.close()
        self._clients.close()


def _socket() -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    one.setblocking(False)
    return one
