"""Fleet files from the command line: what can be flown is drawn, what cannot is refused in one line."""

import itertools
import socket
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from agent.air.vehicle import VehicleAddressError
from protocols.fleet.document import FleetError
from rsc_swarm.air.bodies import vehicle_of
from rsc_swarm.air.plans import read_plan
from rsc_swarm.cli import main as cli
from rsc_swarm.show.plots.room import told

EXAMPLES = Path(__file__).parents[3] / "examples"


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", *words])
    with pytest.raises(SystemExit) as left:
        cli.main()
    return int(left.value.code or 0)


@pytest.mark.parametrize(
    ("name", "size"),
    [("room.yaml", (6, 4)), ("hall.yaml", (12, 8)), ("six.yaml", (6, 4)), ("one.yaml", (6, 4))],
)
def test_the_examples_can_be_flown_in_the_rooms_they_are_for(name: str, size: tuple[float, float]) -> None:
    plan = read_plan(EXAMPLES / name)
    fence = plan.fleet.fence
    assert (fence.x_m[1] - fence.x_m[0], fence.y_m[1] - fence.y_m[0]) == size


def test_a_plan_is_drawn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "plan.svg"
    assert (
        run(monkeypatch, "ground", "--fleet", str(EXAMPLES / "room.yaml"), "--check", "--out", str(picture))
        == 0
    )
    assert "can be flown by 6 drones" in capsys.readouterr().out
    assert picture.stat().st_size > 5000


def test_a_plans_picture_says_what_it_cannot_show(tmp_path: Path) -> None:
    turned = {"yaw_deg": 1.5708, "height_m": 1.2, "world": {"obstacles_m": [[-1.6, -0.35, 0.12]]}}
    text = told(read_plan(fleet_file(tmp_path, **turned)))
    for words in (
        "6 drones, mission lab-small",
        "turned by 1.5708 degrees",
        "1.2 m high (fence 0 to 1.6 m)",
        "1.25 m/s",
    ):
        assert words in text


def test_a_check_tells_what_may_go_wrong(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    crazyflies = [{"body": f"crazyflie:radio://0/80/2M/E7E7E7E70{n}"} for n in range(6)]
    file, picture = fleet_file(tmp_path, *crazyflies), str(tmp_path / "plan.png")
    assert run(monkeypatch, "ground", "--fleet", str(file), "--check", "--out", picture) == 0
    assert "dongle 0 leads 6 Crazyflies: more than 3 are led badly by one" in capsys.readouterr().err


def test_a_check_looks_for_the_keys(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    file, picture = fleet_file(tmp_path, keys="keys"), tmp_path / "plan.png"
    assert run(monkeypatch, "ground", "--fleet", str(file), "--check", "--out", str(picture)) == 2
    told = f"there is no folder {tmp_path / 'keys'}; make it with 'rsc-swarm keys {tmp_path / 'keys'} --fleet {file}'"
    assert told in capsys.readouterr().err
    assert picture.exists()


def test_a_mission_beside_the_fleet_file_is_found(tmp_path: Path) -> None:
    shipped = EXAMPLES.parent / "rsc_swarm" / "missions" / "lab-small.yaml"
    (tmp_path / "mine.yaml").write_text(shipped.read_text())
    text = (EXAMPLES / "room.yaml").read_text()
    (tmp_path / "fleet.yaml").write_text(text.replace("mission: lab-small", "mission: mine.yaml"))
    assert (
        read_plan(tmp_path / "fleet.yaml").mission_digest == read_plan(EXAMPLES / "room.yaml").mission_digest
    )
    (tmp_path / "fleet.yaml").write_text(text.replace("mission: lab-small", "mission: yours.yaml"))
    with pytest.raises(
        FleetError, match=r"mission: there is no file .*yours\.yaml; name one, or one that comes"
    ):
        read_plan(tmp_path / "fleet.yaml")


def fleet_file(folder: Path, *changes: dict[str, Any], **fields: Any) -> Path:
    """The example's, with ``changes`` to its drones."""
    room = yaml.safe_load((EXAMPLES / "room.yaml").read_text())
    drones = [
        drone | change for drone, change in itertools.zip_longest(room["drones"], changes, fillvalue={})
    ]
    (folder / "fleet.yaml").write_text(yaml.safe_dump(room | {"drones": drones} | fields))
    return folder / "fleet.yaml"


CRAZYFLIE, OVER_ANOTHER = "crazyflie:radio://0/80/2M/E7E7E7E701", "crazyflie:radio://1/80/2M/e7e7e7e701"
AUTOPILOT, ANOTHER = "mavlink:udpin:127.0.0.1:14550", "mavlink:udpin:127.0.0.1:14551"
SOURCE = {"endpoint": "tcp/127.0.0.1:7447"}
MEANS_NOTHING: list[tuple[list[dict[str, Any]], dict[str, Any], str]] = [
    ([], {"positions": SOURCE}, "positions: no drone of this fleet is a Crazyflie"),
    ([{"body": AUTOPILOT}], {"positions": SOURCE}, "positions: no drone of this fleet is a Crazyflie"),
    ([{"dongle": 1}], {}, "drones.0: point: has no dongle: a point shares no radio; leave dongle out"),
    ([{}, {"body": AUTOPILOT, "dongle": 0}], {}, "drones.1: mavlink:.* has no dongle: a mavlink shares no radio"),
    ([{"options": {"host": "tcp/127.0.0.1:7470"}}], {}, "drones.0: point: has no option 'host': a point has none"),
    ([{"options": {"origin": "1,2,3"}}], {}, "drones.0: point: has no option 'origin'"),
    ([{"body": AUTOPILOT, "options": {"host": "tcp/127.0.0.1:7470"}}], {}, "has no option 'host': its only option is origin"),
    ([{"body": CRAZYFLIE, "options": {"origin": "1,2,3"}}], {}, "has no option 'origin': its only option is host"),
    ([{"body": CRAZYFLIE, "dongle": 1}], {}, "drones.0.dongle: 1, and radio://0/80/2M/E7E7E7E701 is reached by dongle 0"),
    ([{"body": CRAZYFLIE}, {"body": OVER_ANOTHER}], {}, "drones: 0 and 1 have both the body crazyflie:radio://0/80/2M/E7E7E7E701"),
    ([{"body": AUTOPILOT}, {"body": AUTOPILOT + "?system=2"}], {}, "drones: 0 and 1 have both the body mavlink:"),
    ([{"body": AUTOPILOT}, {"body": "mavlink:udpin:localhost:14550"}], {}, "drones: 0 and 1 have both the body mavlink:"),
    ([{"body": AUTOPILOT, "options": {"origin": "47,8,500"}}, {"body": ANOTHER}], {}, "drones: 0 and 1 have different options"),
    ([{"body": AUTOPILOT, "options": {"origin": "47,8,500"}}, {"body": ANOTHER, "options": {"origin": "47,8,501"}}], {},
     "drones: 0 and 1 have different options"),
    ([{"body": "balloon:"}], {}, "drones.0: 'balloon:' is no vehicle"),
    ([{"body": "crazyflie:radio://0"}], {}, "drones.0: crazyflie:radio://0: 'radio://0' is no address"),
    ([{"body": "crazyflie:radio://0/180/2M/E7E7E7E701"}], {}, "is no address of a Crazyflie: .*channel to 125"),
    ([{"body": "crazyflie:radio://0/80/2M/E7E7E7"}], {}, "is no address of a Crazyflie: .*ten digits"),
    ([{"body": "crazyflie:udp://127.0.0.1:99999"}], {}, "is no address of a Crazyflie"),
    ([{"body": "radio://0/80/2M/E7E7E7E701"}], {}, "drones.0: .* is no vehicle: write KIND:WHERE"),
    ([{"body": "mavlink:udpin:1"}], {}, "drones.0: mavlink:udpin:1: 'udpin:1' is no connection"),
    ([{"body": "point:frozn@3"}], {}, "drones.0: point:frozn@3: 'frozn@3' is nothing"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "fields", "why"), MEANS_NOTHING, ids=[why[:60] for *_, why in MEANS_NOTHING]
)
def test_what_would_mean_nothing_to_a_body_is_refused(
    tmp_path: Path, changes: list[dict[str, Any]], fields: dict[str, Any], why: str
) -> None:
    with pytest.raises(FleetError, match=why) as refusal:
        read_plan(fleet_file(tmp_path, *changes, **fields))
    assert str(refusal.value).startswith(str(tmp_path))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("command", ["air", "ground"])
def test_keys_that_are_not_there_are_told_once(
    command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, none = fleet_file(tmp_path, keys="none"), tmp_path / "none"
    assert run(monkeypatch, command, "--fleet", str(file)) != 0
    (told,) = capsys.readouterr().err.splitlines()
    assert f"keys: there is no folder {none}; make it with 'rsc-swarm keys {none} --fleet {file}'" in told


def test_every_companion_computer_has_a_line_of_its_own_to_its_autopilot(tmp_path: Path) -> None:
    serial = "mavlink:serial:/dev/ttyAMA0:921600"
    drones = [
        {"body": serial, "address": f"udp/10.0.0.{10 + n}:7450", "options": {"origin": "47,8,500"}}
        for n in range(6)
    ]
    plain: dict[str, Any] = {"radio": {"plain_text": True}, "ground": "udp/10.0.0.1:7450"}
    assert read_plan(fleet_file(tmp_path, *drones, **plain)).fleet.drones[5].body == serial
    drones[5]["address"] = "udp/10.0.0.14:7451"
    with pytest.raises(FleetError, match="drones: 4 and 5 have both the body"):
        read_plan(fleet_file(tmp_path, *drones, **plain))


@pytest.mark.parametrize(
    ("body", "leaves"),
    [
        ("mavlink:udpin:127.0.0.1:14550", False),
        ("mavlink:serial:/dev/ttyAMA0:921600", False),
        ("mavlink:udpin:0.0.0.0:14550", True),
        ("mavlink:udpout:10.0.0.7:14550", True),
        ("mavlink:tcp:autopilot.local:5760?system=3", True),
    ],
)
def test_an_autopilot_is_led_over_a_network_only_by_an_explicit_word(
    tmp_path: Path, body: str, leaves: bool
) -> None:
    plain = {"radio": {"plain_text": True}}
    assert read_plan(fleet_file(tmp_path, {"body": body}, **plain)).fleet.drones[0].body == body
    if leaves:
        with pytest.raises(
            FleetError, match=r"drones.0: mavlink:.* is plain text, and who changes it on the way"
        ) as refusal:
            read_plan(fleet_file(tmp_path, {"body": body}))
        assert "\n" not in str(refusal.value)
    fleet = read_plan(fleet_file(tmp_path))
    if leaves:  # nor by the command line
        with pytest.raises(FleetError, match="is plain text"):
            vehicle_of(fleet, 0, body)
    else:
        vehicle_of(fleet, 0, body)


def test_a_radio_host_has_no_keys(tmp_path: Path) -> None:
    with pytest.raises(
        FleetError, match=r"drones.0: options: host: a radio host has no keys; write tcp/127.0.0.1:7470"
    ):
        read_plan(fleet_file(tmp_path, {"body": CRAZYFLIE, "options": {"host": "tls/127.0.0.1:7470"}}))


def test_a_fleet_in_the_air_is_told_before_a_second_one_starts(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """One of its drones listens there already."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        file = fleet_file(tmp_path, radio={"port": max(1024, port - 3)})
        assert run(monkeypatch, "air", "--fleet", str(file)) == 3
    told = capsys.readouterr().err.strip()
    assert (
        f"cannot listen at udp/127.0.0.1:{port}: another program does. Is this fleet in the air already"
        in told
    )
    assert "\n" not in told


def test_keys_on_the_command_line_are_for_fleets_with_keys(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    own = tmp_path / "login"
    words = ("fly", "--agent", "0", "--credentials", str(own), "--fleet")
    assert run(monkeypatch, *words, str(fleet_file(tmp_path))) == 2
    assert (
        f"--credentials {own}: {tmp_path}/fleet.yaml has no keys; name their folder there"
        in capsys.readouterr().err
    )
    assert run(monkeypatch, *words, str(fleet_file(tmp_path, keys="keys"))) == 3
    assert f"{own}: cannot be read" in capsys.readouterr().err


BAD = [
    (("fly", "--agent", "6", "--fleet", "room.yaml"), "--agent 6: the fleet's drones are 0 to 5"),
    (("fly", "--agent", "0", "--fleet", "none.yaml"), "none.yaml: cannot be read"),
    (
        ("fly", "--agent", "0", "--fleet", "room.yaml", "--body", "balloon:"),
        "'balloon:' is no vehicle: write KIND:WHERE",
    ),
    (
        ("fly", "--agent", "0", "--fleet", "room.yaml", "--trouble", "gremlins"),
        "'gremlins' is none; write loss=0.3",
    ),
    (("air", "--fleet", "room.yaml", "--trouble", "loss=0.3"), "write the drone's number first"),
    (("air", "--fleet", "room.yaml", "--trouble", "9:loss=0.3"), "write the drone's number first"),
    (
        ("ground", "--fleet", "room.yaml", "--do", "arm,fly"),
        "'fly' is no step; known: preflight, arm, takeoff",
    ),
    (("ground", "--fleet", "room.yaml", "--do", ""), "--do: nothing; write steps"),
    (("ground", "--fleet", "room.yaml", "--do", "wait=²"), "'wait=²' is no step; known: preflight"),
]


@pytest.mark.parametrize(("words", "why"), BAD, ids=[why for _, why in BAD])
def test_what_cannot_be_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], why: str
) -> None:
    monkeypatch.chdir(EXAMPLES)
    assert run(monkeypatch, *words) == 2
    told = capsys.readouterr().err.strip()
    assert why in told
    assert "\n" not in told


def test_an_empty_body_is_none(tmp_path: Path) -> None:
    """It was taken for no answer, and the body in the fleet file was led."""
    with pytest.raises(VehicleAddressError):
        vehicle_of(read_plan(fleet_file(tmp_path)), 0, "")
