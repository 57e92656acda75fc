"""A network of machines on this one: each is a network namespace, and between them a switch that loses, delays and cuts.

A namespace has one interface, a TUN device, whose other end the switch holds: it reads every packet and hands it on, or not. So
it treats all protocols alike, and no module of the kernel for bad networks is needed. It needs root, and is for Linux.
"""

import ctypes
import fcntl
import heapq
import os
import random
import select
import signal
import socket
import struct
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass
from types import TracebackType
from typing import Self

from rsc_swarm.machine.priority import go_first

_TUNSETIFF, _TUN, _NO_HEADER, _NEW_NET = 0x400454CA, 0x0001, 0x1000, 0x40000000
_BURST = 20  # packets read from one machine before it is the next one's turn
_IP = subprocess.run(["which", "ip"], capture_output=True, text=True, check=False).stdout.strip()


def why_not() -> str | None:
    """Why there can be no such network here."""
    if os.geteuid():
        return "network namespaces need root"
    if not _IP:
        return "there is no 'ip' (package iproute2)"
    if not os.path.exists("/dev/net/tun"):
        return "there is no /dev/net/tun"
    try:
        with Wires(1):
            return None
    except (OSError, subprocess.CalledProcessError) as error:
        return f"no network namespaces here ({error})"


@dataclass(frozen=True)
class Rules:
    """How every way between two machines is, in either direction. cut: machines from and to which nothing passes.

    Delays are drawn for each packet, so one may overtake another.
    """

    loss: float = 0.0
    delay_s: float = 0.0
    jitter_s: float = 0.0
    cut: tuple[int, ...] = ()


def address(machine: int) -> str:
    return f"10.77.0.{machine + 1}"


def _enter(name: str) -> None:
    with open(f"/run/netns/{name}") as namespace:
        if ctypes.CDLL(None, use_errno=True).setns(namespace.fileno(), _NEW_NET):
            raise OSError(ctypes.get_errno(), f"cannot enter {name}")


def _ip(*words: str) -> None:
    subprocess.run([_IP, *words], check=True, capture_output=True)


class Wires:
    """``machines`` machines with the addresses `address`, joined by a switch that is a process of its own."""

    def __init__(self, machines: int, seed: int = 0) -> None:
        self._names = [f"rsc-test-{os.getpid()}-{machine}" for machine in range(machines)]
        self._children: list[int] = []
        self._ends: list[int] = []
        try:
            for machine, name in enumerate(self._names):
                self._ends.append(self._make(machine, name))
        except BaseException:
            self._remove()
            raise
        self._tell, told = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._switch = self._fork(lambda: _Switch(self._ends, told, seed).run())
        told.close()

    def _make(self, machine: int, name: str) -> int:
        _ip("netns", "add", name)
        end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        interface = f"rsc{os.getpid() % 100_000}.{machine}"
        fcntl.ioctl(end, _TUNSETIFF, struct.pack("16sH22x", interface.encode(), _TUN | _NO_HEADER))
        _ip("link", "set", interface, "netns", name)
        for words in (
            f"addr add {address(machine)}/24 dev {interface}",
            f"link set {interface} up",
            "link set lo up",
        ):
            _ip("-n", name, *words.split())
        return end

    def rule(self, rules: Rules) -> None:
        """From now on it is like this."""
        self._tell.send(repr(astuple(rules)).encode())

    def start(self, machine: int, target: Callable[[], int]) -> int:
        """Run this in a process of its own on a machine; its number. The process ends with what ``target`` returns."""

        def run() -> int:
            _enter(self._names[machine])
            return target()

        return self._fork(run)

    def reset_connections(self, machine: int) -> None:
        """Break every TCP connection of a machine, as a router does that has forgotten them."""
        _ip("netns", "exec", self._names[machine], "ss", "--kill", "--tcp", "state", "connected")

    def _fork(self, run: Callable[[], int]) -> int:
        sys.stdout.flush()
        pid = os.fork()
        if pid:
            self._children.append(pid)
            return pid
        code = 70
        try:
            code = run()
        except BaseException:
            traceback.print_exc()
        finally:
            with suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(code)

    def wait(self, pid: int) -> int:
        """The exit code of a process that `start` has started; minus the signal that ended it."""
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        self._children.remove(pid)
        return code

    def _remove(self) -> None:
        for child in self._children:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
        for end in self._ends:
            os.close(end)
        for name in self._names:
            subprocess.run([_IP, "netns", "del", name], capture_output=True, check=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._tell.close()
        self._remove()


class _Switch:
    def __init__(self, ends: list[int], told: socket.socket, seed: int) -> None:
        self._ends, self._told, self._rules, self._chance = ends, told, Rules(), random.Random(seed)
        self._under_way: list[tuple[float, int, int, bytes]] = []
        self._count = 0

    def run(self) -> int:
        """Until nobody rules any more. A network is not slower where a machine is busy."""
        go_first()
        poll = select.poll()
        for end in (*self._ends, self._told.fileno()):
            poll.register(end, select.POLLIN)
        while True:
            now = time.monotonic()
            while self._under_way and self._under_way[0][0] <= now:
                _, _, end, packet = heapq.heappop(self._under_way)
                with suppress(OSError):
                    os.write(end, packet)
            wait_ms = 1e3 * (self._under_way[0][0] - now) if self._under_way else 100.0
            for end, _ in poll.poll(wait_ms):
                if end != self._told.fileno():
                    self._take(end)
                elif said := self._told.recv(4096):
                    self._rules = Rules(*eval(said))
                else:
                    return 0

    def _take(self, end: int) -> None:
        for _ in range(_BURST):
            try:
                packet = os.read(end, 65_536)
            except BlockingIOError:
                return
            if packet[0] >> 4 != 4:
                continue
            source, target = packet[15] - 1, packet[19] - 1
            rules = self._rules
            if (
                target >= len(self._ends)
                or {source, target}.intersection(rules.cut)
                or self._chance.random() < rules.loss
            ):
                continue
            late = rules.delay_s + rules.jitter_s * self._chance.uniform(-1, 1)
            self._count += 1
            heapq.heappush(
                self._under_way, (time.monotonic() + late, self._count, self._ends[target], packet)
            )
