"""Faults a mission asks for: done to real processes, they make the flight that the simulation makes."""

import json
import subprocess
import sys
from typing import Any, get_args

from protocols.mission.fault import LieName
from tests.rsc_swarm.watch.test_hands import HANDS
from tests.scenarios.flights import ROOT, Fields, launched, whole
from tests.scenarios.test_twins import flown_here, simulated

TASK: Fields = {
    "agents": 6,
    "formation": {"shape": "triangle"},
    "fly_s": 3.0,
    "swap": {"silent_s": 0.5},
    "seed": 6,
}


def fault(at_s: float, kind: str, **what: Any) -> Fields:
    return {"at_s": at_s, "kind": kind, **what}


FAULTS: dict[str, list[Fields]] = {
    "kill": [fault(1, "kill", slots=[1])],
    "freeze-and-thaw": [fault(1, "freeze", agents=[2]), fault(2, "thaw", agents=[2])],
    "frozen-to-the-end": [fault(1, "freeze", agents=[3])],
    "restart": [fault(1, "restart", agents=[1])],
    "killed-and-restarted": [fault(1, "kill", agents=[1, 4]), fault(2.5, "restart", agents=[1])],
    "frozen-and-restarted": [fault(1, "freeze", slots=[4]), fault(1.5, "restart", slots=[4])],
    "restarted-when-its-leader-is-dead": [fault(1, "kill", slots=[1]), fault(1.2, "restart", slots=[0])],
    "restarted-twice": [fault(1, "restart", agents=[1]), fault(2, "restart", agents=[1])],
    "part-and-heal": [fault(0.3, "part", groups=[[0, 1, 2], [3, 4, 5]]), fault(2.5, "heal")],
    "loss-and-none": [fault(0.5, "loss", loss=0.8), fault(1.5, "loss", loss=0.0)],
    "slow-and-recover": [fault(0, "slow", slots=[4], factor=0.5), fault(2, "recover", slots=[4])],
    "lies-of-one-and-another": [
        fault(round(0.1 + 0.3 * number, 2), "lie", agents=[number % 4], lie=lie)
        for number, lie in enumerate(get_args(LieName))
    ],
    "lies-and-truth": [
        fault(0.5, "lie", slots=[2], lie="observation"),
        fault(1, "truth", slots=[2]),
    ],
    "thaw-of-the-dead": [
        fault(0.5, "freeze", agents=[0]),
        fault(1, "kill", agents=[0]),
        fault(1.5, "thaw", agents=[0]),
    ],
}


def test_every_fault_flies_in_processes_as_it_does_in_one() -> None:
    tasks = [{**TASK, "faults": faults} for faults in FAULTS.values()]
    flights = dict(zip(FAULTS, launched(*tasks), strict=True))
    undisturbed = simulated(TASK)["digest"]
    for name, task in zip(FAULTS, tasks, strict=True):
        outcome = flights[name]["outcome"]
        assert (outcome, whole(flights[name]["report"])) == flown_here(task), name
        assert outcome["digest"] != undisturbed, name
        assert flights[name]["breach"] is None, name
        assert outcome["ticks"] == 300, name
    assert flights["kill"]["outcome"]["lost_agents"] == [1]
    assert flights["restart"]["outcome"]["lost_agents"] == []
    assert flights["killed-and-restarted"]["outcome"]["lost_agents"] == [4]
    assert flights["thaw-of-the-dead"]["outcome"]["lost_agents"] == [0]


def test_faults_in_a_scrambled_swarm_fly_in_processes_as_in_one() -> None:
    faults = [
        fault(0.4, "part", groups=[[0, 1, 2], [3, 4, 5]]),
        fault(0.8, "freeze", agents=[1]),
        fault(1.2, "thaw", agents=[1]),
        fault(1.4, "heal"),
        fault(1.5, "kill", slots=[4]),
        fault(2.5, "restart", agents=[5]),
    ]
    task = {**TASK, "start": {"scrambled": True}, "faults": faults, "radio": {"loss": 0.2}}
    (flight,) = launched(task)
    assert (flight["outcome"], whole(flight["report"])) == flown_here(task)


_FLY_BY_HAND = """
import dataclasses, json, sys
from protocols.mission.document import parse_mission
from rsc_swarm.flight.launch import launch
from rsc_swarm.flight.world_process import Inside
from tests.rsc_swarm.watch.handed import Handed

task, hands = json.loads(sys.argv[1])
flown = launch(parse_mission(task), inside=Inside(onlooker=Handed({int(at): fault for at, fault in hands.items()}))).whole()
print(json.dumps([dataclasses.asdict(flown.outcome), [fault.model_dump(mode="json") for fault in flown.by_hand]]))
"""


def test_what_hands_do_to_real_processes_is_the_flight_of_a_mission_with_these_faults() -> None:
    run = subprocess.run(
        [sys.executable, "-c", _FLY_BY_HAND, json.dumps([TASK, HANDS])], cwd=ROOT, capture_output=True, text=True, timeout=200
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    outcome, by_hand = json.loads(run.stdout)
    assert [fault["kind"] for fault in by_hand] == [fault["kind"] for fault in HANDS.values()]
    assert outcome == simulated({**TASK, "faults": by_hand})
