"""Fleets whose vehicles are those of other makers: real client libraries, fake vehicles, real processes, no world."""

import itertools
import json
import math
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

from protocols.closing import Closing
from rsc_swarm.air.plans import read_plan
from tests.fakes.motion import Motion
from tests.fakes.udp import Wires
from tests.scenarios.fleets import Fleet
from tests.scenarios.vehicles import KINDS, Vehicles

OFF_THE_GROUND_M = 0.1
# Of the ticks: on a machine that cannot keep up all still land safely, but perhaps not in formation.
MOST_MISSED = 0.01
# 0.07 to 0.16 were seen: the processes of all drones, their fakes and two hosts share two cores.
SLOT_ERROR_M = 0.2
# All processes of this test have to wait for their turns on a busy machine; how fast a guard is, tests of its own say.
PATIENCE = {
    "position_hold_s": 1.0,
    "position_land_s": 5.0,
    "clock_hold_ms": 500,
    "clock_land_ms": 2000,
    "jump_m": 1.5,
}


class Ruler(Closing):
    """Measures, 50 times a second, how near to each other those come that are off the ground: the truth, whoever flew where."""

    def __init__(self, wires: Wires, motions: Sequence[Motion]) -> None:
        self.nearest, self._over = math.inf, threading.Event()
        self._wires, self._motions = wires, motions
        self._thread = threading.Thread(target=self._measure, daemon=True)
        self._thread.start()

    def _measure(self) -> None:
        while not self._over.wait(0.02):
            with self._wires.lock:
                up = [motion.p for motion in self._motions if motion.p[2] > OFF_THE_GROUND_M]
            for one, other in itertools.combinations(up, 2):
                self.nearest = min(self.nearest, math.dist(one[:2], other[:2]))

    def close(self) -> None:
        self._over.set()
        self._thread.join()


def fly_the_mission(folder: Path, vehicles: Vehicles) -> None:
    """Take off, form, pass the obstacle, land; nobody comes too near to anybody, falls, or misses its slot."""
    drones, wires, motions = vehicles
    fleet = Fleet(folder, drones=drones, guard=PATIENCE)
    plan = read_plan(fleet.file)
    with fleet.in_the_air(), Ruler(wires, motions) as ruler:
        operator = fleet.operator("preflight,arm,takeoff,go")
        operator.wait(timeout=250)
    assert fleet.log.count("ground (landed)") == len(drones), fleet.told + fleet.log
    assert ruler.nearest >= plan.limit_m
    assert not any(motion.fell for motion in motions)
    reports = [json.loads(file.read_text()) for file in folder.glob("drone-*/1/report.json")]
    assert len(reports) == len(drones)
    if max(report["missed"] for report in reports) < MOST_MISSED * plan.ticks:
        assert operator.returncode == 0, fleet.told + fleet.log
        assert "SUCCESS" in fleet.told
        assert max(report["slot_error_m"] for report in reports) <= SLOT_ERROR_M


@pytest.mark.parametrize(("kind", "library"), [("crazyflie", "cflib"), ("mavlink", "pymavlink")])
def test_six_fly_the_mission(tmp_path: Path, kind: str, library: str) -> None:
    """Crazyflies behind two radio hosts; autopilots of two makes."""
    pytest.importorskip(library, reason="the extra with it is not installed")
    with KINDS[kind]() as vehicles:
        fly_the_mission(tmp_path, vehicles)
