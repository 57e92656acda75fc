"""Who flies, and the operator, before anything is flown."""

import socket
from pathlib import Path

import pytest

from agent.air.trouble import Trouble
from protocols.wire.keys import LinkError
from rsc_swarm.air import alone
from rsc_swarm.air.plans import read_plan
from rsc_swarm.air.processes import fly_all
from rsc_swarm.air.tower import watch
from rsc_swarm.flight.key_files import KeyFileError
from rsc_swarm.flight.run_dir import RunDirError
from tests.scenarios.fleets import Fleet


def test_a_process_that_was_started_twice_leaves_its_vehicle_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first may have it in the air."""
    plan = read_plan(Fleet(tmp_path).file)
    monkeypatch.setattr(alone, "vehicle_of", lambda *_: None)  # nothing can be asked of it
    _, _, place = plan.fleet.address(3).partition("/")
    host, _, port = place.rpartition(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first:
        first.bind((host, int(port)))
        with pytest.raises(LinkError, match=r"another program does\. Is this fleet in the air already"):
            alone.fly_drone(plan, 3, None, None, None, Trouble())


class Silent:
    """A vehicle of which nothing is asked but to be opened and closed."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def open(self, timeout_s: float) -> None:
        self.done.append("open")

    def close(self) -> None:
        self.done.append("close")


def test_a_drone_whose_keys_cannot_be_read_closes_its_vehicle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle = Silent()
    monkeypatch.setattr(alone, "vehicle_of", lambda *_: vehicle)
    monkeypatch.setattr(alone, "load", lambda _: None)
    with pytest.raises(KeyFileError):
        alone.fly_drone(read_plan(Fleet(tmp_path).file), 3, tmp_path / "none.json", None, None, Trouble())
    assert vehicle.done == ["open", "close"]


@pytest.mark.parametrize("where", ["file", "file/beneath"])
def test_where_no_flight_can_be_kept_nothing_is_flown(where: str, tmp_path: Path) -> None:
    """After it would be too late."""
    (tmp_path / "file").write_text("")
    plan = read_plan(Fleet(tmp_path).file)
    with pytest.raises(RunDirError, match=r"--run-dir .*; give a directory that can be written"):
        alone.fly_drone(plan, 3, None, None, tmp_path / where, Trouble())
    with pytest.raises(RunDirError):
        fly_all(plan, None, tmp_path / where, {})
    with pytest.raises(RunDirError):
        watch(plan, None, lambda *_: False, None, tmp_path / where)
