"""Valid files and words of a user for the targets, made by the code that writes them: they follow when a format changes."""

import hashlib
import io
import json
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from protocols.mission.document import Mission
from protocols.mission.reading import write_yaml
from protocols.wire.login import Login
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.training.config import PRESETS, TrainingConfig
from tests.models import metadata, straight_on, written
from world.outlets.trajectory import Trajectory
from world.server.credentials import Credentials, Keys, make_keys

ROOT = Path(__file__).parents[2]
MODEL = b"not looked into"
FLOWN = Mission(agents=2)
TODAY = datetime(2026, 1, 1, tzinfo=UTC)
ADDRESS = "10.0.0.1"


def fleets() -> Iterator[bytes]:
    for name in ("room", "hall"):
        yield (ROOT / "examples" / f"{name}.yaml").read_bytes()
    drones = [{"number": me, "address": f"quic/10.0.0.{me + 1}:7450", "dongle": 0} for me in range(6)]
    full: dict[str, Any] = {
        "mission": "lab", "origin_m": [-5.2, 0], "scale": 0.3, "fence": {"x_m": [-6, 6], "y_m": [-4, 4]}, "drones": drones,
        "keys": "keys", "ground": "quic/10.0.0.9:7450", "slot_heights_m": [1, 1.1, 1.2, 1, 1, 1], "obstacles_m": [[0, 0, 0.2]],
        "guard": {"hold_s": 5}, "radio": {"frame_rate_hz": 50, "port": 8000}, "yaw_deg": 2,
    }  # fmt: skip
    yield write_yaml(full).encode()


@cache
def keys_of(now: datetime, address: str = ADDRESS) -> Keys:
    """Of a swarm of two, made ``now``."""
    return make_keys("rsc", 2, [address, "world.example"], 365, now)


def logins() -> Iterator[bytes]:
    yield Login("rsc", 3, "secret").to_json().encode()
    yield keys_of(TODAY).logins[0].to_json().encode()


def world_keys() -> Iterator[bytes]:
    yield Credentials("rsc", ("a", "b")).to_json().encode()
    yield keys_of(TODAY).world.to_json().encode()


def missions() -> Iterator[bytes]:
    yield from (file.read_bytes() for file in sorted((ROOT / "rsc_swarm" / "missions").glob("*.yaml")))
    faults: list[dict[str, Any]] = [
        {"at_s": 1, "kind": "part", "groups": [[0, 1], [2]]},
        {"at_s": 2, "kind": "heal"},
        {"at_s": 3, "kind": "freeze", "agents": [1]},
        {"at_s": 4, "kind": "thaw", "agents": [1]},
        {"at_s": 4, "kind": "slow", "agents": [2], "factor": 0.3},
        {"at_s": 5, "kind": "recover", "agents": [2]},
        {"at_s": 5, "kind": "kill", "slots": [0]},
        {"at_s": 6, "kind": "restart", "slots": [0]},
    ]
    full: dict[str, Any] = {
        "agents": 3,
        "formation": {"shape": "custom", "slots_m": [[0, 0], [-5, 0], [-10, 0]]},
        "obstacles": {"discs": [[20, 0, 2]]},
        "faults": faults,
        "radio": {"burst": {"loss": 0.1}, "memory_s": 2, "reorder": 0.1, "delay_ms": 20},
        "goal_x_m": 30,
        "swap": {"rule": "tree", "answer_s": 5, "silent_s": 50},
        "trajectory": {"replan_ticks": 5},
        "time_limit_s": 60,
        "hold_s": 2,
    }
    yield write_yaml(full).encode()
    yield b"agents: 3\npolicy: homing.py:Homing\nfly_s: 1.5\n"


def settings() -> Iterator[bytes]:
    yield b"restart\nhold_s=1"
    yield b"hold_s=2\nstart.scrambled=true\nradio.burst={loss: 0.1, length_s: 2}\nname='x y'\npolicy=a.py:B"
    yield b"formation.shape=custom\nformation.slots_m=[[0, 0], [5, 0]]\nagents=2\nswap.rule=off\nswap.rule.x=1"


def words() -> Iterator[bytes]:
    yield b"rsc\ntcp/192.168.1.10:7447\nrsc-h20"
    yield b"wedge-1\nunixsock-stream//tmp/world.sock\nmodel.onnx"
    yield b"a_b\ntls/[::1]:7447\nhoming.py:Homing"
    yield b"rsc\nquic/host:1\nanalytic"
    yield b"rsc\nws/host:1\nnowhere"


def model_notes() -> Iterator[bytes]:
    sha256 = hashlib.sha256(MODEL).hexdigest()
    for changes in (
        {},
        {"extra": "wide", "output": "raw"},
        {"kind": "stgnn", "output": "action", "horizon": "1", "replan": "1"},
    ):
        yield json.dumps({**metadata(20, **changes), "sha256": sha256}, indent=1).encode()


def journals() -> Iterator[bytes]:
    from rsc_swarm.selfcheck.trials import Trial
    from rsc_swarm.study.workers import Flight
    from world.invariants import Watched
    from world.outcome import Outcome

    won = Outcome(True, None, 1500, 15.0, 3.0, 0.05, 0.3, 0.9, "x", None, 0.0, (), "ab")
    lost = Outcome(False, "collision", 900, None, None, 0.5, 3.0, 0.4, "x", False, 0.1, (1,), "cd")
    watched = Watched(None, 0.1, 0.2, None, True, 3, 0)
    flights = [
        Flight(0, 0, won, watched, dict.fromkeys(SWAP_COUNTS, 1)),
        Flight(1, 1000, lost, watched, dict.fromkeys(SWAP_COUNTS, 0)),
    ]
    yield "".join(json.dumps(asdict(flight)) + "\n" for flight in flights).encode()
    yield json.dumps(asdict(flights[0])).encode()
    yield json.dumps(
        Trial("late", 0, (), True, None, 20.0, 1.5, 160.0, "struck off: late")._asdict()
    ).encode()


def tables() -> Iterator[bytes]:
    for name in ("1", "2", "slots"):
        table = json.loads((ROOT / "docs" / "results" / f"table-{name}.json").read_bytes())
        rows = [
            {**row, "failures": {kind: seeds[:2] for kind, seeds in row["failures"].items()}}
            for row in table["rows"]
        ]
        for some in (rows[:2], rows[-1:], []):
            yield json.dumps({**table, "rows": some}, indent=1).encode()


def reports() -> Iterator[bytes]:
    yield b'{"tau_s": 15.01, "failure": null, "digest": "ab"}'
    yield b'{"tau_s": null, "failure": "collision"}'


def recordings() -> Iterator[bytes]:
    moments, drones = 3, 2
    flown = Trajectory(
        np.zeros((moments, drones, 2)), np.ones((moments, drones, 2)), np.zeros((moments, drones), np.int16),
        np.ones((moments, drones), np.bool_), np.ones((1, 3)), 30.0, 0.01,
    )  # fmt: skip
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.npz"
        flown.save(path)
        yield path.read_bytes()


def curves() -> Iterator[bytes]:
    yield b'{"updates": 100, "loss": 0.5, "success": null}\n{"updates": 200, "loss": NaN}\n'


def trainings() -> Iterator[bytes]:
    for preset in PRESETS.values():
        yield json.dumps(preset).encode()
    yield TrainingConfig().model_dump_json(indent=1).encode()
    yield b"# paper\n"


def checkpoints() -> Iterator[bytes]:
    import torch

    state = {
        "version": 2,
        "config": TrainingConfig().model_dump_json(),
        "curve": [{"updates": 1.0}],
        "learner": {"w": torch.ones(2)},
    }
    for changes in ({}, {"version": 1}, {"config": TrainingConfig(seed=5).model_dump_json()}):
        file = io.BytesIO()
        torch.save({**state, **changes}, file)
        yield file.getvalue()


@cache
def _small_model() -> bytes:
    with TemporaryDirectory() as folder:
        return written(Path(folder) / "small.onnx", 2, straight_on(2)).read_bytes()


def models() -> Iterator[bytes]:
    yield _small_model()
