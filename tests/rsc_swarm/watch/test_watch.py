"""A live page: what it is shown, that it costs the flight nothing, and who may look."""

import json
import socket
import time
import urllib.error
import urllib.request
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from protocols.mission.document import Mission
from rsc_swarm.flight.in_process import fly
from rsc_swarm.flight.simulate import Simulation, simulate
from rsc_swarm.watch.recording import Recording
from rsc_swarm.watch.window import Window
from world.outlets.picture import COLUMNS, FLYING, FROZEN, LOST, picture, scene, unpacked

pytest.importorskip("starlette", reason="the page needs the extra 'view'")
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from rsc_swarm.watch.server import Shown
from rsc_swarm.watch.site import Asked, Site, ViewError, served

MISSION = Mission(
    agents=4,
    fly_s=1.0,
    faults=[{"at_s": 0.2, "kind": "kill", "agents": [2]}, {"at_s": 0.3, "kind": "freeze", "agents": [1]}],
)


def flown(ticks: int) -> Simulation:
    simulation = Simulation([MISSION])
    for _ in range(ticks):
        simulation.tick()
    return simulation


def test_a_picture_says_where_all_are_and_how():
    simulation = flown(50)
    core = simulation.world
    shown = picture(core, simulation.director.statuses, 2.0)
    told = unpacked(shown.packed())
    assert (told.tick, told.real_time_factor, told.frames, told.swaps) == (50, 2.0, shown.frames, shown.swaps)
    for name in ("drones", "beliefs", "links"):
        assert (getattr(told, name) == getattr(shown, name)).all(), name
    drones = told.drones
    assert drones[:, 0:2] == pytest.approx(core.position[0], abs=1e-5)
    assert drones[:, COLUMNS.index("slot")].tolist() == core.claim[0].tolist()
    assert drones[:, COLUMNS.index("state")].tolist() == [FLYING, FROZEN, LOST, FLYING]
    assert np.isfinite(drones).all()
    assert json.loads(json.dumps(scene(core)))["agents"] == 4


def test_plans_are_where_drones_will_be():
    simulation = Simulation([Mission(agents=4, policy="rsc-h20", obstacles={"count": (0, 0)})])
    for _ in range(101):
        simulation.tick()
    director = simulation.director
    plans = unpacked(picture(director.core, {}, 1.0, plans=director.plans()).packed()).plans
    assert plans.shape == (4, 4, 2)
    furthest = np.nanargmax(np.where(np.isnan(plans[:, :, 0]), -np.inf, 1.0 * np.arange(4)), axis=1)
    meant = plans[range(4), furthest]
    assert np.isfinite(meant).all(), "everybody has planned something that is not over"
    nearest = np.full(4, np.inf)
    for _ in range(21):
        nearest = np.minimum(nearest, np.linalg.norm(director.core.position[0] - meant, axis=1))
        simulation.tick()
    assert (nearest < 0.1).all()


def test_beliefs_are_those_that_are_wrong():
    simulation = flown(10)
    statuses = dict(simulation.director.statuses)
    view = bytearray(statuses[3].view)
    view[0], view[1] = view[1], view[0]
    statuses[3] = statuses[3]._replace(view=bytes(view))
    beliefs = unpacked(picture(simulation.world, statuses, 1.0).packed()).beliefs
    assert beliefs.tolist() == [[3, 0, view[0]], [3, 1, view[1]]]


def test_a_recording_gives_what_was_missed_thinned_with_the_newest():
    kept = Recording(most_bytes=1000, most_at_once=100)
    for tick in range(15):
        kept.add(tick, bytes([tick]) * 10)
    newest, told = kept.since(11)
    assert (newest, told) == (14, b"".join(b"\x0a\0\0\0" + bytes([tick]) * 10 for tick in (12, 13, 14)))
    newest, told = kept.since(-1)
    assert newest == 14
    assert len(told) <= 100 + 8 * 4
    assert told.endswith(bytes([14]) * 10)
    for tick in range(15, 500):
        kept.add(tick, bytes(10))
    assert len(kept) <= 101
    assert kept.since(498)[0] == 499
    assert kept.since(499) == (499, b"")


def test_a_recording_of_a_flight_that_is_over_is_given_whole_piece_by_piece():
    kept = Recording(most_bytes=100, most_at_once=100)
    kept.whole = True
    for tick in range(0, 400, 4):
        kept.add(tick, bytes([tick // 4]) * 10)
    tick, told = -1, b""
    while (piece := kept.since(tick))[1]:
        assert len(piece[1]) <= 14 * 11
        tick, told = piece[0], told + piece[1]
    assert tick == 396
    assert told == b"".join(b"\x0a\0\0\0" + bytes([place]) * 10 for place in range(100))


def test_nobody_reads_and_the_flight_is_the_same():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    with ours, theirs:
        assert fly(MISSION, onlooker=Window(ours)).outcome == simulate([MISSION])[0]


def test_nobody_is_there_any_more_and_the_flight_is_the_same():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.close()
    with ours:
        assert fly(MISSION, onlooker=Window(ours)).outcome == simulate([MISSION])[0]


@pytest.fixture
def site(monkeypatch):
    # Tests before may have opened Zenoh in this process. What is forked here never touches it.
    monkeypatch.setattr("rsc_swarm.flight.processes._refuse_to_fork_zenoh", lambda: None)
    with served(Asked(port=0)) as site:
        yield site


def at(site: Site, path: str, scheme: str = "http") -> str:
    return f"{scheme}{site.address.split('#')[0].removeprefix('http')}{path}"


def get(url: str, **headers: str) -> bytes:
    """What is there, once its server has come up."""
    with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=20) as answer:
        return answer.read()


def test_a_page_that_never_reads_keeps_nobody_waiting(site):
    stalled = socket.socket()
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    host, port = at(site, "").removeprefix("http://").rstrip("/").split(":")
    stalled.connect((host, int(port)))
    stalled.sendall(
        b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    shown = picture(flown(1).world, {}, 1.0)
    big = [replace(shown, tick=tick).packed() + bytes(20_000) for tick in range(1, 1001)]
    with stalled, connect(at(site, "live", "ws"), max_size=None) as page:
        site.window.say({"kind": "hello"})
        assert json.loads(page.recv(20)) == {"kind": "hello"}
        spent = time.process_time()
        for packed in big * 5:
            site.window.show(packed)
        assert (
            time.process_time() - spent < 2.0
        )  # 100 MB: nothing waits, what there is no room for is left out
        seen, deadline = b"", time.monotonic() + 30
        while b'"tick":1000,' not in seen and time.monotonic() < deadline:
            site.window.show(big[-1])
            with suppress(TimeoutError):
                seen = page.recv(0.2)
        assert b'"tick":1000,' in seen


def test_prometheus_reads_the_newest_moment(site):
    simulation = flown(50)
    site.window.attend(simulation.director)
    deadline, told = time.monotonic() + 20, ""
    while "rsc_swarm_time_seconds 0.5" not in told and time.monotonic() < deadline:
        told = get(at(site, "metrics")).decode()
    for line in (
        'drones{state="flying"} 2.0',
        'drones{state="frozen"} 1.0',
        'frames_total{what="sent"}',
        "nearest_meters",
    ):
        assert f"rsc_swarm_{line}" in told


def test_only_pages_of_ours_and_names_of_this_machine(site):
    assert b"<canvas" in get(at(site, ""))
    for path in ("page/page.js", "page/page.css", "page/icon.svg"):
        assert get(at(site, path))
    with pytest.raises(urllib.error.HTTPError, match="400"):
        get(at(site, ""), Host="evil.example")
    with (
        pytest.raises(Exception, match=r"rejected|403|closed"),
        connect(at(site, "live", "ws"), origin="http://evil.example") as page,
    ):
        page.recv(5)


def test_what_is_not_installed_is_said_in_a_line(monkeypatch):
    monkeypatch.setattr("rsc_swarm.watch.site.find_spec", lambda name: None)
    with (
        pytest.raises(ViewError, match=r"--view needs starlette: pip install -e '\.\[view\]'"),
        served(Asked(port=0)),
    ):
        pass


def test_a_port_that_is_taken_is_said_in_a_line(site):
    port = int(site.address.split(":")[2].split("/")[0])
    with pytest.raises(ViewError, match=f"--view-port {port}: .*give another"), served(Asked(port=port)):
        pass
    for host in ("nowhere.invalid", "10.0.0..1"):
        with (
            pytest.raises(ViewError, match=rf"--view-host {host}: .*address of this machine"),
            served(Asked(host)),
        ):
            pass


def test_what_nobody_should_say_to_a_page_harms_no_other(site):
    get(at(site, ""))
    host, port = at(site, "").removeprefix("http://").rstrip("/").split(":")
    for junk in (b"\x16\x03\x01 no request\r\n\r\n", b"GET / HTTP/1.1\r\nHost: \xff\r\n\r\n"):
        with socket.create_connection((host, int(port)), timeout=20) as stranger:
            stranger.sendall(junk)
            assert b" 400 " in stranger.recv(100)
    for words in (b"\x00\xff no text", "[" * 60_000, "x" * 70_000):
        with connect(at(site, "live", "ws")) as page, suppress(ConnectionClosed, TimeoutError):
            page.send(words)
            page.recv(1)
            page.recv(1)
    with connect(at(site, "live", "ws")) as page:
        site.window.say({"kind": "hello"})
        assert json.loads(page.recv(20)) == {"kind": "hello"}


def test_a_hand_is_refused_for_what_keeps_the_flight_from_it():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    theirs.setblocking(False)
    shown = Shown(theirs)
    with theirs:
        with ours:
            assert shown.tell_flight(b"") is None
            assert ours.recv(10) == b"null", "nothing said is no end of all that is said"
            said = [shown.tell_flight(b"{}" * 1000) for _ in range(10_000)]
            assert {*said} == {None, "the flight has not come to what was said before; say it again"}
        assert shown.tell_flight(b"{}") == "the flight does not listen any more"
