"""A machine with systemd on this one: a manager of its own, with a root of its own, in which this project is installed.

Nothing of this machine can be written from there: it sees the system's programs, Python, and the project, all read-only, and its
own empty /etc, /run, /tmp and /var. It has its own processes, network, and cgroups below ours. It needs root, and is for Linux.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from protocols.kept import cache_folder

PROJECT = Path(__file__).parents[2]
_MANAGER = "/usr/lib/systemd/systemd"
_TARGETS = ("basic", "sysinit", "shutdown", "multi-user", "network-online")
_CGROUPS = "/sys/fs/cgroup"
_BELOW = "rsc-swarm-test"
_HOME = "/opt/rsc-swarm"

# $1: where the new root is made; the folders to be seen in it follow, WHAT:WHERE. No unit, generator or rule of the system's
# own is there.
_ROOM = """
set -e
root=$1; shift
mount --make-rprivate /
mount -t tmpfs -o mode=755 room "$root"
cd "$root"
mkdir -p usr etc proc sys dev run tmp var/lib var/cache var/log root home opt/rsc-swarm/bin old
for each in sys dev run; do mount -t tmpfs -o mode=755 none $each; done  # a manager that finds none makes them of the kernel's
mkdir -p sys/fs/cgroup dev/pts dev/shm
chmod 1777 tmp dev/shm
for each in bin sbin lib lib64; do ln -s usr/$each $each; done
for each in "$@"; do
  mkdir -p "$root${each#*:}"
  mount --rbind "${each%%:*}" "$root${each#*:}"
  mount -o remount,bind,ro "$root${each#*:}"
done
for each in system system-generators; do
  [ ! -d usr/lib/systemd/$each ] || mount -t tmpfs none usr/lib/systemd/$each
done
for each in null zero full random urandom tty; do touch dev/$each; mount --bind /dev/$each dev/$each; done
mount -t devpts -o newinstance,ptmxmode=0666 devpts dev/pts
ln -s pts/ptmx dev/ptmx
mount -t proc proc proc
if [ -f /sys/fs/cgroup/cgroup.controllers ]; then
  mount -t cgroup2 cgroup sys/fs/cgroup
else
  mount -t tmpfs none sys/fs/cgroup
  for each in memory pids devices systemd unified; do
    [ -d /sys/fs/cgroup/$each ] || continue
    mkdir sys/fs/cgroup/$each
    case $each in
      unified) mount -t cgroup2 cgroup sys/fs/cgroup/$each;;
      systemd) mount -t cgroup -o none,name=systemd cgroup sys/fs/cgroup/$each;;
      *) mount -t cgroup -o $each cgroup sys/fs/cgroup/$each;;
    esac
  done
fi
cp -a /etc/ld.so.* etc/
cp -a "$root.etc/." etc/
chown -R root:root etc
cp -a "$root.bin/." opt/rsc-swarm/bin/
if [ -d "$root.cache" ]; then cp -r "$root.cache" var/cache/rsc-swarm; chown -R 990:990 var/cache/rsc-swarm; fi
ip link set lo up
pivot_root . old
umount -l /old
mount --make-rshared /  # as a manager that is no guest has it: credentials come by a mount
exec env -i container=test PATH=/usr/bin:/usr/sbin SYSTEMD_UNIT_PATH=/etc/systemd/system LANG=C.UTF-8 \\
  /usr/lib/systemd/systemd --system --unit=basic.target --show-status=no --log-target=console --log-level=notice
"""
_COMMAND = """#!/bin/sh
export LD_LIBRARY_PATH=/opt/rsc-swarm/python/lib PYTHONPATH=/opt/rsc-swarm/src:/opt/rsc-swarm/site PYTHONDONTWRITEBYTECODE=1
exec /opt/rsc-swarm/python/bin/{python} -m rsc_swarm "$@"
"""
_ACCOUNTS = {
    "passwd": "root:x:0:0::/root:/bin/sh\nnobody:x:65534:65534::/:/bin/false\nrsc-swarm:x:990:990::/:/bin/false\n",
    "group": "root:x:0:\ntty:x:5:\ndialout:x:20:\nnogroup:x:65534:\nrsc-swarm:x:990:\n",
    "nsswitch.conf": "passwd: files\ngroup: files\nhosts: files\n",
    "hosts": "127.0.0.1 localhost\n",
    "machine-id": "1" * 32 + "\n",
}


def why_not() -> str | None:
    """Why there can be no such machine here."""
    if os.geteuid():
        return "a manager of its own needs root"
    for program in (_MANAGER, "unshare", "nsenter", "pivot_root", "ip"):
        if not shutil.which(program):
            return f"there is no {program}"
    if not os.access(_CGROUPS, os.W_OK):
        return f"{_CGROUPS} cannot be written"
    tried = subprocess.run(
        ["unshare", "--mount", "--pid", "--net", "--cgroup", "--fork", "true"], capture_output=True
    )
    return None if tried.returncode == 0 else "no namespaces here"


class Machine:
    """A machine with the units of `deploy/`, and what else is put into ``folder`` / "etc" before its ``with`` block."""

    def __init__(self, folder: Path) -> None:
        """``folder``: empty; what it keeps of it here."""
        self._root = folder / "root"
        self.etc, self._bin = folder / "root.etc", folder / "root.bin"
        units = self.etc / "systemd" / "system"
        for each in (self._root, self._bin, units, self.etc / "rsc-swarm"):
            each.mkdir(parents=True)
        for file in (PROJECT / "deploy").glob("*.service"):
            shutil.copy(file, units)
        shutil.copy(PROJECT / "deploy" / "swarm.env", self.etc / "rsc-swarm")
        for target in _TARGETS:
            (units / f"{target}.target").write_text(f"[Unit]\nDescription={target}\nDefaultDependencies=no\n")
        for name, text in _ACCOUNTS.items():
            (self.etc / name).write_text(text)
        # There is no journal: what a service says is in a file.
        self.change("service", "[Service]\nStandardOutput=append:/var/log/%n\nStandardError=inherit\n")
        command = self._bin / "rsc-swarm"
        command.write_text(_COMMAND.format(python=Path(sys.executable).resolve().name))
        command.chmod(0o755)
        if kept := cache_folder():
            shutil.copytree(kept, folder / "root.cache")
        self._log = (folder / "manager.log").open("w")
        self._cgroups: list[Path] = []

    def change(self, unit: str, text: str) -> None:
        """Add settings to a unit, or with "service" to all services."""
        folder = self.etc / "systemd" / "system" / f"{unit}.d"
        folder.mkdir(exist_ok=True)
        (folder / f"{unit}-{len(list(folder.iterdir()))}.conf").write_text(text)

    def __enter__(self) -> Self:
        site = sysconfig.get_path("purelib")
        places = (
            "/usr:/usr",
            f"{sys.base_prefix}:{_HOME}/python",  # which may be /usr, too
            f"{site}:{_HOME}/site",
            f"{PROJECT}:{_HOME}/src",
        )
        kinds = ("mount", "pid", "net", "cgroup", "uts", "ipc", "fork", "kill-child")
        self._manager = subprocess.Popen(
            ["unshare", *(f"--{kind}" for kind in kinds), "bash", "-c", _ROOM, "room", str(self._root), *places],
            stdout=self._log, stderr=self._log, stdin=subprocess.DEVNULL, preexec_fn=self._go_below,
        )  # fmt: skip
        deadline = time.monotonic() + 20.0
        while not self._is_up():
            assert self._manager.poll() is None, self.log
            assert time.monotonic() < deadline, self.log
            time.sleep(0.1)
        return self

    def _is_up(self) -> bool:
        """Once the child of `unshare` is the manager it has a root of its own."""
        children = Path(f"/proc/{self._manager.pid}/task/{self._manager.pid}/children").read_text().split()
        return bool(children) and self.systemctl("is-active", "basic.target") == "active"

    def _go_below(self) -> None:
        """Let this process, and the manager that it becomes, be in cgroups of their own."""
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, kinds, path = line.split(":", 2)
            name = kinds.removeprefix("name=") or (
                "" if Path(_CGROUPS, "cgroup.controllers").exists() else "unified"
            )
            if name in ("memory", "pids", "devices", "systemd", "unified", ""):
                below = Path(_CGROUPS, name, path.strip("/"), f"{_BELOW}-{os.getppid()}")
                if below.parent.is_dir():
                    below.mkdir(exist_ok=True)
                    (below / "cgroup.procs").write_text("0")

    @property
    def log(self) -> str:
        """What the manager said."""
        return Path(self._log.name).read_text()

    def run(self, *words: str, timeout_s: float = 60.0) -> "subprocess.CompletedProcess[str]":
        """A program on that machine."""
        return subprocess.run([*self._within(), *words], capture_output=True, text=True, timeout=timeout_s)

    def start(self, *words: str) -> "subprocess.Popen[str]":
        """As `run`, beside us; what it says is thrown away."""
        return subprocess.Popen(
            [*self._within(), *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True
        )

    def _within(self) -> list[str]:
        children = Path(f"/proc/{self._manager.pid}/task/{self._manager.pid}/children").read_text().split()
        assert children, self.log
        return ["nsenter", "--target", children[0], "--all", "--root", "--wd"]

    def systemctl(self, *words: str, timeout_s: float = 60.0) -> str:
        """What it answers."""
        ran = self.run("systemctl", *words, timeout_s=timeout_s)
        return (ran.stdout + ran.stderr).strip()

    def show(self, unit: str, *names: str) -> list[str]:
        """Properties of a unit."""
        return [self.systemctl("show", "--value", "--property", name, unit) for name in names]

    def said(self, unit: str) -> str:
        """What a service has said."""
        return self.run("cat", f"/var/log/{unit}.service").stdout

    def until(self, unit: str, name: str, value: str, timeout_s: float) -> None:
        """Wait for a property of a unit."""
        deadline = time.monotonic() + timeout_s
        while (found := self.show(unit, name)[0]) != value:
            assert time.monotonic() < deadline, f"{unit}: {name} is {found}\n{self.said(unit)}\n{self.log}"
            time.sleep(0.1)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._manager.kill()  # its children go with it
        self._manager.wait()
        self._log.close()
        time.sleep(0.2)
        for folder in sorted(
            Path(_CGROUPS).rglob(f"{_BELOW}-{os.getpid()}/**/"), key=lambda path: -len(path.parts)
        ):
            folder.rmdir()
