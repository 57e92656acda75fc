"""Passwords and keys are nowhere to be seen: on no command line, in no environment, no log, no report, no folder of a run."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

import rsc_swarm as rs

SHORT = ["--agents", "2", "--map", "3", "--set", "fly_s=1"]
# The command, which also tells the test, in a file of its own, what it keeps secret.
TELLTALE = """
import sys
from pathlib import Path
from rsc_swarm.cli.main import main
from world.server.credentials import Credentials
fresh, kept = Credentials.fresh, sys.argv.pop(1)
def told(*arguments):
    made = fresh(*arguments)
    Path(kept).write_text(made.to_json())
    return made
Credentials.fresh = staticmethod(told)
main()
"""


def secrets_of(file: Path) -> set[bytes]:
    """All that is secret in a file of keys: each password, and every line of each private key."""

    def leaves(node: Any, name: str = "") -> Iterator[str]:
        if isinstance(node, dict):
            for key, value in node.items():
                yield from leaves(value, key)
        elif isinstance(node, list):
            for each in node:
                yield from leaves(each, name)
        elif any(word in name for word in ("password", "private", "signing")):
            yield from node.splitlines()

    found = {line.encode() for line in leaves(json.loads(file.read_text())) if "PRIVATE KEY" not in line}
    assert min(map(len, found)) >= 16
    return found


class Watch:
    """What can be seen of some processes and their children from outside, and all they leave behind in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seen: dict[str, bytes] = {}
        self.started: list[subprocess.Popen[bytes]] = []

    def start(self, name: str, *command: str) -> subprocess.Popen[bytes]:
        output = (self.folder / f"{name}.output").open("wb")
        where = {"XDG_RUNTIME_DIR": str(self.folder), "TMPDIR": str(self.folder), "RUST_LOG": "debug"}
        process = subprocess.Popen(
            command, stdout=output, stderr=subprocess.STDOUT, cwd=self.folder, env=os.environ | where
        )
        self.started.append(process)
        return process

    def look_until_all_have_ended(self) -> None:
        deadline = time.monotonic() + 200
        while any(process.poll() is None for process in self.started):
            assert time.monotonic() < deadline
            self.look()
            time.sleep(0.1)
        self.look()

    def look(self) -> None:
        for process in self.started:
            with suppress(psutil.NoSuchProcess):
                launcher = psutil.Process(process.pid)
                for each in (launcher, *launcher.children(recursive=True)):
                    for what in ("cmdline", "environ"):
                        self._keep(Path(f"/proc/{each.pid}/{what}"))
        for folder, _, files in os.walk(self.folder):  # which does not mind a folder that is gone meanwhile
            for file in files:
                self._keep(Path(folder, file))

    def _keep(self, path: Path) -> None:
        with suppress(OSError):
            self.seen[str(path)] = path.read_bytes()

    def shows(self, secrets: set[bytes]) -> list[str]:
        return [where for where, content in self.seen.items() if any(secret in content for secret in secrets)]


@pytest.fixture
def watch(tmp_path: Path) -> Iterator[Watch]:
    (tmp_path / "seen").mkdir()
    watch = Watch(tmp_path / "seen")
    yield watch
    for process in watch.started:
        process.kill()


def test_a_launch_shows_no_password(watch: Watch, tmp_path: Path) -> None:
    kept = tmp_path / "credentials.json"
    output = ["--run-dir", str(watch.folder / "run"), "--json", str(watch.folder / "report.json")]
    watch.start("launch", sys.executable, "-c", TELLTALE, str(kept), "launch", *SHORT, *output)
    watch.look_until_all_have_ended()
    secrets = secrets_of(kept)
    assert len(secrets) >= 2
    assert any(name.endswith("agent-1.log") for name in watch.seen)
    assert len([name for name in watch.seen if name.endswith("cmdline")]) >= 4
    assert (watch.folder / "run" / "report.json").is_file()
    assert watch.shows(secrets) == []


def test_a_world_and_its_drones_with_keys_show_none_of_them(watch: Watch, tmp_path: Path) -> None:
    keys, rsc = tmp_path / "keys", [sys.executable, "-m", "rsc_swarm"]
    subprocess.run([*rsc, "keys", str(keys), "--agents", "2"], check=True, capture_output=True)
    secrets = set().union(*(secrets_of(file) for file in keys.iterdir()))
    assert len(secrets) >= 2 + 3 * 3
    endpoint = f"tls/127.0.0.1:{20_000 + os.getpid() % 10_000}"
    watch.start("world", *rsc, "world", "--listen", endpoint, "--keys", str(keys), *SHORT, "--run-dir", "run")
    for agent in range(2):
        own = ["--agent", str(agent), "--credentials", str(keys / f"agent-{agent}.json")]
        watch.start(f"agent-{agent}", *rsc, "agent", "--connect", endpoint, *own)
    watch.look_until_all_have_ended()
    report = json.loads((watch.folder / "run" / "report.json").read_text())
    assert watch.shows(secrets) == []
    assert watch.shows({endpoint.encode()})  # what is not secret is seen where it is looked for
    twin = rs.simulate([rs.mission(agents=2, map_seed=3, fly_s=1)])[0].report
    assert report["digest"] == twin.digest  # what is encrypted on its way is the same flight
