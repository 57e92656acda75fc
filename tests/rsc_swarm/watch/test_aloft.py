"""A fleet on the air, as its operator hears it, on the page."""

import json
import socket
from pathlib import Path

import numpy as np

from rsc_swarm.air.plans import read_plan
from rsc_swarm.air.station import Station
from rsc_swarm.watch.aloft import Aloft
from rsc_swarm.watch.window import PICTURE, WORD, Window
from world.outlets.picture import unpacked

ROOM = Path(__file__).parents[3] / "examples" / "room.yaml"


def test_who_is_heard_in_flight_is_shown_where_it_is() -> None:
    plan = read_plan(ROOM)
    station = Station(plan, "1", 0)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.setblocking(False)
    attended: list[float] = []

    def attend(station: Station, utc_us: int, now: float) -> bool:
        attended.append(now)
        return now < 3.0

    aloft = Aloft(Window(ours), attend)
    with ours, theirs:
        assert aloft(station, 0, 1.0)  # on the ground there is nothing to see
        log = station.log
        log.positions[:6] = np.arange(12).reshape(6, 2)
        log.flying[:6, :5] = True
        log.rows = 6
        assert aloft(station, 0, 2.0)
        assert not aloft(station, 0, 3.0)
        messages = [theirs.recv(1 << 20) for _ in range(2)]
    assert attended == [1.0, 2.0, 3.0]
    assert messages[0][:1] == WORD
    assert json.loads(messages[0][1:])["scene"]["agents"] == 6
    assert messages[1][:1] == PICTURE
    shown = unpacked(messages[1][1:])
    assert shown.tick == 5
    assert shown.drones[:, :2].tolist() == np.arange(12).reshape(6, 2).tolist()
    assert shown.drones[:, 5].tolist() == [2, 2, 2, 2, 2, 0]
