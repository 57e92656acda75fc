"""The units of deploy/ under a systemd of their own (tests.scenarios.services), as they are but for a shorter watchdog."""

import json
import shutil
import time
from pathlib import Path

import pytest
import yaml

from rsc_swarm.flight.key_files import make_fleet_key_files, make_key_files
from tests.scenarios.fleets import EXAMPLES
from tests.scenarios.services import Machine, why_not
from world.server.credentials import FleetHosts

HERE = "127.0.0.1"
UNITS = ("rsc-swarm-fly@0", "rsc-swarm-agent@0", "rsc-swarm-world")
AS_ITS_USER = ("setpriv", "--reuid=990", "--regid=990", "--clear-groups", "env", "XDG_CACHE_HOME=/var/cache")
COMMAND = "/opt/rsc-swarm/bin/rsc-swarm"


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    if reason := why_not():
        pytest.skip(reason)
    made = Machine(tmp_path)
    for unit in ("rsc-swarm-fly@", "rsc-swarm-agent@"):
        made.change(f"{unit}.service", "[Service]\nWatchdogSec=5\n")
    return made


def settings(machine: Machine, **changed: str) -> None:
    """Change what the units read from swarm.env."""
    file = machine.etc / "rsc-swarm" / "swarm.env"
    lines = [line.split("=", 1) for line in file.read_text().splitlines() if line[:1] not in ("", "#")]
    file.write_text("".join(f"{name}={value}\n" for name, value in {**dict(lines), **changed}.items()))


def test_systemd_understands_every_word_of_the_units(machine: Machine) -> None:
    with machine:
        for unit in UNITS:
            told = machine.run(
                "systemd-analyze", "verify", f"/etc/systemd/system/{unit.replace('@0', '@')}.service"
            )
            assert (told.returncode, told.stdout, told.stderr) == (0, "", "")


def test_a_drone_on_the_air_flies_is_started_again_when_it_hangs_and_lands_before_it_leaves(
    machine: Machine,
) -> None:
    folder, unit = machine.etc / "rsc-swarm", UNITS[0]
    fleet = yaml.safe_load((EXAMPLES / "one.yaml").read_text()) | {
        "keys": "keys",
        "guard": {"setpoint_land_s": 5},
    }
    (folder / "fleet.yaml").write_text(yaml.safe_dump(fleet))
    shutil.copy(EXAMPLES / fleet["mission"], folder)
    make_fleet_key_files(folder / "keys", "rsc", FleetHosts([HERE], HERE), 1, overwrite=False)
    (folder / "keys" / "agent-0.json").rename(folder / "agent-0.json")
    settings(machine, RSC_BODY="--body point:")

    def order(steps: str) -> tuple[str, ...]:
        return *AS_ITS_USER, COMMAND, "ground", "--fleet", "/etc/rsc-swarm/fleet.yaml", "--do", steps

    with machine:
        assert machine.systemctl("start", unit, timeout_s=300) == "", machine.said(unit) + machine.log
        assert machine.show(unit, "StatusText", "MemoryMax", "LimitNOFILE") == [
            f"drone 0 at quic/{HERE}:7451", str(1 << 30), "256",
        ]  # fmt: skip
        (process,) = machine.show(unit, "MainPID")
        status = dict(
            line.split(":", 1) for line in machine.run("cat", f"/proc/{process}/status").stdout.splitlines()
        )
        assert [status[name].split()[0] for name in ("Uid", "CapBnd", "NoNewPrivs", "Seccomp")] == [
            "990",
            "0" * 16,
            "1",
            "2",
        ]

        machine.run("chown", "-R", "990", "/etc/rsc-swarm/keys")
        flown = machine.run(*order("preflight,arm,takeoff,wait=1,land"), timeout_s=120)
        assert flown.returncode == 0, flown.stderr + machine.said(unit)

        machine.run("kill", "-STOP", process)
        machine.until(unit, "NRestarts", "1", 60)
        machine.until(unit, "ActiveState", "active", 60)
        assert machine.show(unit, "MainPID") != [process]

        operator = machine.start(*order("preflight,arm,takeoff"))
        deadline = time.monotonic() + 60
        while machine.said(unit).count("form (climbed)") < 2:
            assert time.monotonic() < deadline, machine.said(unit)
            time.sleep(0.1)
        assert machine.systemctl("stop", unit) == ""
        assert machine.show(unit, "ActiveState", "Result") == ["inactive", "success"]
        assert machine.said(unit).splitlines()[-1] == "drone 0: ground (landed)"
        operator.terminate()
        operator.wait(60)

        assert machine.systemctl("start", unit, timeout_s=300) == "", machine.said(unit)
        assert machine.systemctl("stop", unit) == ""  # nobody is there who would answer its farewell
        assert machine.show(unit, "ActiveState", "Result") == ["inactive", "success"], machine.said(unit)


def test_a_world_and_its_drones_fly_as_services(machine: Machine) -> None:
    folder = machine.etc / "rsc-swarm"
    make_key_files(folder / "keys", "rsc", 2, [HERE], 1, overwrite=False)
    for name in ("world.json", "agent-0.json", "agent-1.json"):
        (folder / "keys" / name).rename(folder / name)
    at = f"tls/{HERE}:7447"
    settings(machine, RSC_LISTEN=at, RSC_CONNECT=at, RSC_FLIGHT="--agents 2 --set fly_s=1")
    drones = ["rsc-swarm-agent@0", "rsc-swarm-agent@1"]
    with machine:
        assert machine.systemctl("start", *drones, timeout_s=300) == "", "".join(map(machine.said, drones))
        assert machine.show(drones[1], "StatusText") == [f"looking for the world at {at}"]
        (process,) = machine.show(drones[0], "MainPID")
        machine.run("kill", "-STOP", process)
        machine.until(drones[0], "NRestarts", "1", 60)
        machine.until(drones[0], "ActiveState", "active", 60)
        assert machine.systemctl("stop", drones[0]) == ""
        assert machine.show(drones[0], "ActiveState", "Result") == ["inactive", "success"], machine.said(
            drones[0]
        )
        assert machine.systemctl("start", drones[0], timeout_s=300) == "", machine.said(drones[0])
        assert machine.systemctl("start", "rsc-swarm-world", timeout_s=300) == "", machine.said(
            "rsc-swarm-world"
        )
        for unit in ("rsc-swarm-world", *drones):
            machine.until(unit, "ActiveState", "inactive", 120)
            assert machine.show(unit, "Result") == ["success"], machine.said(unit)
        report = json.loads(machine.run("cat", "/var/lib/rsc-swarm/last-flight/report.json").stdout)
        assert (report["agents"], report["time_s"]) == (2, 1.0)
