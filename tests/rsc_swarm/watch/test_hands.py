"""Hands on a flight: what they did is written down as faults, and with these the flight flies so again."""

import json
import shlex
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from protocols.errors import ExitCode
from protocols.mission.document import Mission, parse_mission, read_mission_fields
from rsc_swarm.cli import simulate as command
from rsc_swarm.cli.commands import loaded
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.simulate import simulate
from rsc_swarm.watch.hands import HandError, Pace, read_hand
from rsc_swarm.watch.window import WORD, Window
from tests.rsc_swarm.watch.handed import Handed
from world.outcome import Flown

MISSION = Mission(agents=6, formation={"shape": "triangle"}, fly_s=2.5, swap={"silent_s": 0.5}, seed=6)
HANDS: Mapping[int, dict[str, Any]] = {
    20: {"kind": "loss", "loss": 0.3},
    40: {"kind": "kill", "agents": [1, 4]},
    60: {"kind": "part", "groups": [[0, 2], [3, 5]]},
    90: {"kind": "freeze", "agents": [2]},
    120: {"kind": "heal"},
    150: {"kind": "thaw", "agents": [2]},
    180: {"kind": "restart", "agents": [4]},
}


def as_flown(mission: Mission, flown: Flown) -> Mission:
    return mission.model_copy(update={"faults": (*mission.faults, *flown.by_hand)})


def test_what_hands_did_flies_again_bit_for_bit() -> None:
    flown = fly(MISSION, onlooker=Handed(HANDS))
    assert [fault.at_tick for fault in flown.by_hand] == list(HANDS)
    again = parse_mission(as_flown(MISSION, flown).model_dump(mode="json"))
    told = fly(again)
    assert told.outcome == flown.outcome
    assert told.watched == flown.watched
    assert flown.outcome.digest != simulate([MISSION])[0].digest


def test_a_hand_that_would_do_nothing_is_refused_in_a_line() -> None:
    onlooker = Handed({10: {"kind": "kill", "agents": [1]}, 20: {"kind": "kill", "agents": [1]}, 30: {"kind": "heal"},
                       40: {"kind": "freeze", "agents": [9]}, 50: {"kind": "explode"}, 60: {"kind": "loss"},
                       70: {}})  # fmt: skip
    flown = fly(MISSION, onlooker=onlooker)
    assert [fault.at_tick for fault in flown.by_hand] == [10]
    refused = [word["text"] for word in onlooker.words if word["kind"] == "refused"]
    assert len(refused) == 6
    for text, part in zip(
        refused,
        ("drone 1 is dead already", "not parted", "no agent or slot 9", "kind", "say which share", "kind"),
        strict=True,
    ):
        assert part in text
        assert "\n" not in text


def test_a_mission_that_kills_a_drone_later_is_not_broken_by_a_hand() -> None:
    mission = MISSION.model_copy(
        update={"faults": parse_mission({"faults": [{"at_s": 2, "kind": "kill", "agents": [1]}]}).faults}
    )
    onlooker = Handed({10: {"kind": "kill", "agents": [1]}})
    flown = fly(mission, onlooker=onlooker)
    assert flown.by_hand == ()
    assert "drone 1 is dead already at 2 s" in onlooker.words[-1]["text"]


def test_a_flight_that_is_paused_waits_and_goes_on_as_if_nothing_had_been() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    window, waited = Window(ours), []

    class Pausing:
        def attend(self, director: Any) -> float:
            if director.clock == 50 and len(waited) < 3:
                theirs.send(json.dumps({"pace": {"speed": None, "paused": len(waited) < 2}}).encode())
                waited.append(wait := window.attend(director))
                return wait
            return window.attend(director)

    with ours, theirs:
        assert fly(MISSION, onlooker=Pausing()).outcome == simulate([MISSION])[0]
    assert [wait > 0 for wait in waited] == [True, True, False]


def test_a_slow_flight_is_slow() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    began = time.monotonic()
    with ours, theirs:
        fly(MISSION.model_copy(update={"fly_s": 0.3}), onlooker=Window(ours, Pace(speed=0.5)))
    assert time.monotonic() - began >= 0.5


def test_by_the_clock_nothing_waits() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        theirs.send(b'{"pace": {"speed": 0.5, "paused": true}}')
        fly(MISSION.model_copy(update={"fly_s": 0.2}), onlooker=Window(ours, paced=False))
        told = [theirs.recv(1 << 20) for _ in range(3)]
    assert told[0].startswith(WORD + b'{"kind":"scene"')
    assert any(b"goes at the pace of the clock" in word for word in told)


@pytest.mark.parametrize(
    "said",
    [b"", b"[]", b"7", b"null", b'{"fault": 3}', b'{"fault": {"kind": "kill", "at_s": 0}}', b'{"pace": []}', b"[" * 5000, b"\xff",
     b'{"pace": {"speed": 0, "paused": true}}',
     b'{"pace": {"speed": NaN, "paused": true}}', b'{"pace": {"speed": 1, "paused": 1}}',
     b'{"pace": {"speed": "x", "paused": true}}', b'{"pace": {"speed": 1}}',
     b'{"pace": {"speed": 1%s, "paused": true}}' % (b"0" * 400),
     b'{"pace": {"speed": true, "paused": true}}', b'{"fault": {}, "pace": {}}',
     b'{"fault": {"kind": "kill", "kind": "freeze", "agents": [1]}}', b'{"pace": {"speed": 2, "speed": 1, "paused": true}}'],
)  # fmt: skip
def test_what_is_no_hand_is_refused(said: bytes) -> None:
    with pytest.raises(HandError, match="say a fault without its time, or a pace"):
        read_hand(said)


def test_a_run_folder_holds_what_hands_did(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = command._fly
    monkeypatch.setattr(command, "_fly", lambda flight: real(flight._replace(onlooker=Handed(HANDS))))
    run = tmp_path / "run"
    words = [
        "--agents",
        "6",
        "--formation",
        "triangle",
        "--seed",
        "6",
        "--set",
        "fly_s=2.5",
        "--set",
        "swap.silent_s=0.5",
    ]
    told = []
    for more in (["--run-dir", str(run)], []):
        code = loaded()(
            ["simulate", *words, *more, "--json", str(tmp_path / "report.json")], standalone_mode=False
        )
        assert code == ExitCode.FAILED
        told.append(json.loads((tmp_path / "report.json").read_text()))
    monkeypatch.undo()
    kept = parse_mission(read_mission_fields(run / "mission.yaml"))
    assert [fault.at_tick for fault in kept.faults] == list(HANDS)
    kinds = [json.loads(line)["what"] for line in (run / "events.jsonl").read_text().splitlines()]
    assert {"kill", "part", "loss", "restart"} <= set(kinds)
    for report in told:
        assert len(report["mission"]["faults"]) == len(HANDS)
        again = shlex.split(report["again"])[1:]
        loaded()([*again, "--json", str(tmp_path / "again.json")], standalone_mode=False)
        assert json.loads((tmp_path / "again.json").read_text())["digest"] == report["digest"]
