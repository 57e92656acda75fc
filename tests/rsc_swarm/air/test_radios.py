"""Which radio hosts a fleet needs, and what is said when it cannot have them."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from protocols.fleet.document import FleetError
from protocols.fleet.plan import Plan
from rsc_swarm.air.plans import read_plan
from rsc_swarm.air.radios import radio_of, radios_of

ROOT = Path(__file__).parents[3]
ROOM = yaml.safe_load((ROOT / "examples" / "room.yaml").read_text())


def plan(folder: Path, *changes: dict[str, Any], **fields: Any) -> Plan:
    """The fleet of the example, with other drones and ``fields``."""
    drones = [drone | change for drone, change in zip(ROOM["drones"], changes, strict=True)]
    (folder / "fleet.yaml").write_text(yaml.safe_dump(ROOM | {"drones": drones} | fields))
    return read_plan(folder / "fleet.yaml")


def crazyflie(number: int, dongle: int = 0) -> dict[str, Any]:
    return {"body": f"crazyflie:radio://{dongle}/80/2M/E7E7E7E70{number}"}


def test_a_dongle_leads_those_whose_addresses_name_it(tmp_path: Path) -> None:
    fleet = plan(tmp_path, *[crazyflie(number, number // 3) for number in range(5)], {"body": "point:"})
    first, second = radios_of(fleet)
    assert [drone for drone, _ in first.drones] == [0, 1, 2]
    assert second.drones == ((3, "radio://1/80/2M/E7E7E7E703"), (4, "radio://1/80/2M/E7E7E7E704"))
    assert (second.dongle, second.endpoint) == (1, "tcp/127.0.0.1:7471")
    assert second.doubts == []
    assert radio_of(fleet, 1) == second
    settings = json.loads(second.settings)
    assert settings["swarm"] == "rsc"
    assert settings["charges"][1]["drone"] == 4
    assert settings["charges"][1]["limits"]["braking_mps2"] == fleet.acceleration_mps2 / 2


def test_the_radio_hosts_know_who_tells_where_their_crazyflies_are(tmp_path: Path) -> None:
    source = {"endpoint": "tcp/127.0.0.1:7447", "key": "mocap/cf{number}/place"}
    fleet = plan(tmp_path, *[crazyflie(number, number // 3) for number in range(6)], positions=source)
    settings = json.loads(radios_of(fleet)[1].settings)
    assert settings["positions"] == "tcp/127.0.0.1:7447"
    assert [charge["position_key"] for charge in settings["charges"]] == [
        f"mocap/cf{n}/place" for n in (3, 4, 5)
    ]


@pytest.mark.parametrize(
    ("source", "body", "why"),
    [
        ({"endpoint": "nowhere"}, "crazyflie", "positions: endpoint: 'nowhere' is not an endpoint"),
        ({"endpoint": "tcp/127.0.0.1:1", "key": "mocap"}, "crazyflie", "key: 'mocap' is no key with the drone's number"),
        ({"endpoint": "tcp/127.0.0.1:1", "key": "**/{number}"}, "crazyflie", "positions: key: .* is no key"),
        ({"endpoint": "tcp/10.0.0.9:1"}, "crazyflie", "positions.endpoint: tcp/10.0.0.9:1 is plain text"),
        ({"endpoint": "tcp/127.0.0.1:1"}, "point", "positions: no drone of this fleet is a Crazyflie"),
    ],
    ids=["no endpoint", "one key for all", "a key of stars", "plain text", "nobody to be told"],
)  # fmt: skip
def test_a_source_of_positions_that_cannot_be(
    tmp_path: Path, source: dict[str, str], body: str, why: str
) -> None:
    bodies = [crazyflie(number) if body == "crazyflie" else {} for number in range(6)]
    with pytest.raises(FleetError, match=why):
        radios_of(plan(tmp_path, *bodies, positions=source))


def test_the_six_of_the_example_have_two_dongles() -> None:
    radios = radios_of(read_plan(ROOT / "examples" / "six.yaml"))
    assert [(radio.dongle, len(radio.drones), radio.doubts) for radio in radios] == [(0, 3, []), (1, 3, [])]


def test_the_fleet_file_may_say_which_dongle_and_where_its_host_listens(tmp_path: Path) -> None:
    bodies = [
        crazyflie(number) | {"dongle": 7, "options": {"host": "tcp/10.0.0.3:7000"}} for number in range(6)
    ]
    with pytest.raises(FleetError, match=r"drones.0: options: host: tcp/10.0.0.3:7000 is plain text"):
        plan(tmp_path, *bodies)
    (radio,) = radios_of(plan(tmp_path, *bodies, radio={"plain_text": True}))
    assert (radio.dongle, radio.endpoint) == (7, "tcp/10.0.0.3:7000")
    assert radio.doubts == [
        "dongle 7 leads 6 Crazyflies: more than 3 are led badly by one; share them out among more"
    ]


@pytest.mark.parametrize(
    ("changes", "dongle", "why"),
    [
        (
            [{}] * 6,
            None,
            "no drone of this fleet is a Crazyflie: one has body: crazyflie:radio://0/80/2M/E7E7E7E701",
        ),
        ([crazyflie(1), *[{}] * 5], 1, "no drone of this fleet is a Crazyflie on dongle 1"),
        (
            [crazyflie(1, 0), crazyflie(2, 1), *[{}] * 4],
            None,
            r"--dongle: this fleet has several \(0, 1\): say which",
        ),
        (
            [{"body": "crazyflie:radio://0"}, *[{}] * 5],
            None,
            "drones.0: crazyflie:radio://0: 'radio://0' is no address of a Crazyflie",
        ),
        (
            [crazyflie(n, n) | {"options": {"host": "tcp/127.0.0.1:7000"}} for n in range(6)],
            None,
            "host: tcp/127.0.0.1:7000 is that of dongle 0 and of another",
        ),
    ],
)
def test_what_cannot_be_is_refused(
    tmp_path: Path, changes: list[dict[str, Any]], dongle: int | None, why: str
) -> None:
    with pytest.raises(FleetError, match=why) as error:
        radio_of(plan(tmp_path, *changes), dongle)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("settings", "code", "why"),
    [
        ("", 2, "radiohost: settings: Invalid JSON"),
        ("{}", 2, "radiohost: swarm: Field required"),
        (
            '{"swarm": "rsc", "endpoint": "tcp/127.0.0.1:1", "charges": []}',
            2,
            "radiohost: charges: List should",
        ),
        (
            '{"swarm": "rsc", "endpoint": "nowhere", "charges": [{"drone": 0, "uri": "udp://127.0.0.1:9"}]}',
            3,
            "radiohost: cannot listen at nowhere",
        ),
    ],
)
def test_a_radio_host_says_in_one_line_what_is_wrong(settings: str, code: int, why: str) -> None:
    if code == 3:
        pytest.importorskip("cflib", reason="the extra 'radio' is not installed")
    ended = subprocess.run(
        [sys.executable, "-m", "rsc_swarm.radiohost", settings],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.returncode == code
    assert ended.stderr.startswith(why)
    assert ended.stderr.count("\n") == 1


def test_neither_a_drone_nor_the_command_loads_cflib() -> None:
    modules = "agent.air.crazyflie, agent.air.mavlink, rsc_swarm.cli.commands, rsc_swarm.air.processes"
    loaded = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys, {modules}; rsc_swarm.cli.commands.loaded(); print(*sys.modules)",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stdout.split()
    assert "agent.air.crazyflie" in loaded
    assert not {"cflib", "rsc_swarm.radiohost", "pymavlink"} & set(loaded)
