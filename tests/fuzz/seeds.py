"""Valid inputs for the targets, made by the code that writes them: they follow when a format changes."""

import hashlib
import io
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgpack
import numpy as np

from protocols.mission.document import Mission
from protocols.mission.reading import write_yaml
from protocols.slots.history import Swap
from protocols.slots.notes import Acceptance, Assignment, Proposal, Refusal, SlotNote, encode
from protocols.slots.seals import SEAL_BYTES, Sealed
from protocols.wire import messages
from protocols.wire.account import Account as AirAccount
from protocols.wire.beacon import Beacon, pack_beacon
from protocols.wire.frames import (
    FIXED,
    MAX_KNOWN,
    OBSERVATION_SIZE,
    REASONS,
    FrameWriter,
    empty_frames,
    swarm_tag,
)
from protocols.wire.heard import pack_heard
from protocols.wire.login import Login
from protocols.wire.messages import (
    Bye,
    Farewell,
    Hello,
    Ready,
    Refused,
    Reply,
    Wait,
    Welcome,
    make_tick,
    pack,
)
from protocols.wire.operator import Order as OperatorOrder
from protocols.wire.operator import Word, pack_word
from protocols.wire.pieces import cut
from protocols.wire.sensed import SensedPacker, empty_sensed
from protocols.wire.status import SWAP_COUNTS, AgentStatus
from protocols.wire.vehicles import (
    Account,
    Ill,
    Kind,
    Mode,
    Order,
    pack_account,
    pack_fix,
    pack_order,
)
from rsc_swarm.training.config import PRESETS, TrainingConfig
from tests.models import metadata, straight_on, written
from world.outlets.trajectory import Trajectory
from world.server.credentials import Credentials, Keys, make_keys

AGENTS = 6
NOW = 1000
TAG = swarm_tag("rsc")
ROOT = Path(__file__).parents[2]
MODEL = b"not looked into"
FLOWN = Mission(agents=2)
TODAY = datetime(2026, 1, 1, tzinfo=UTC)
ADDRESS = "10.0.0.1"

_SWAP = Swap(3, 1, 77, 0, 2, 3)
_TAKEN = _SWAP._replace(counter=4, taken=True)
_SEAL = bytes(range(SEAL_BYTES))
_NOTES = (
    SlotNote(0x1234567890ABCDEF, settled=True),
    SlotNote(1, settled=False),
    SlotNote(
        2, False, True, Proposal(1, 2**40, 0, 3, 8), Acceptance(2, 5, 9, _SEAL), (Refusal(1, 2), Refusal(0, 3)),
        (Sealed(_SWAP, 2 * _SEAL), Sealed(_TAKEN, _SEAL)), 0b101011, Assignment(tuple(range(AGENTS)), 2, 3),
    ),
    SlotNote(3, False, ops=tuple(Sealed(_SWAP._replace(counter=count), 2 * _SEAL) for count in range(1, 17))),
)  # fmt: skip
_STATUS = AgentStatus(3, 4, (0,) * len(REASONS), (1,) * len(SWAP_COUNTS), 2**63, bytes(range(AGENTS)))


def packed(value: Any) -> bytes:
    """As msgpack writes it."""
    written: bytes = msgpack.packb(value)
    return written


def made(kind: Callable[..., Any], **fields: Any) -> bytes:
    """A message of this kind, whatever values it is given; fields that are not given are 0."""
    names = kind._fields  # type: ignore[attr-defined]
    return pack(kind(**{name: fields.get(name, 0) for name in names}))


def notes() -> Iterator[bytes]:
    yield from (packed(encode(note)) for note in _NOTES)


def frames() -> Iterator[bytes]:
    draw, rows = np.random.default_rng(0), empty_frames(1, TAG)
    for count, note in zip((0, 3, 5, MAX_KNOWN), _NOTES, strict=True):
        rows.tick[0] = NOW - 1 - count
        rows.motion[0] = draw.normal(0, 20, 4)
        rows.observation[0] = draw.integers(-32768, 32768, OBSERVATION_SIZE)
        rows.ages[0] = draw.integers(0, 256, 8)
        rows.sender[0], rows.slot[0], rows.age_from[0] = draw.integers(0, AGENTS, 3)
        rows.known_count[0], rows.one_hop[0] = count, count // 2
        rows.known[0, :count] = draw.integers(0, AGENTS, count)
        rows.displacement[0, :count] = draw.normal(0, 6, (count, 2))
        rows.loud[0], rows.digest[0] = not (note.quiet and note.settled), note.digest
        yield FrameWriter(rows).write(0, packed(encode(note)) if rows.loud[0] else b"")


def heard() -> Iterator[bytes]:
    place = FIXED.fields["sender"][1]
    said = [(frame[place], frame) for frame in frames()]
    for count in range(len(said) + 1):
        yield bytes([count]) + pack_heard(said[:count])


def statuses() -> Iterator[bytes]:
    yield packed(_STATUS)


def from_drone() -> Iterator[bytes]:
    yield made(Hello, version=messages.VERSION, process=7)
    yield made(Ready, process=messages.MAX_PROCESS)
    yield pack(Reply(7, 3, 9, 0.5, -0.5, 5, b"frame", None))
    yield pack(Reply(7, 0, 0, 0.0, 0.0, 0, None, _STATUS))
    yield made(Farewell, process=7, status=_STATUS)


def from_world() -> Iterator[bytes]:
    rows = empty_sensed(1)
    rows.near_count[0], rows.obstacle_count[0] = 2, 1
    yield made(
        Welcome,
        process=7,
        mission={"agents": AGENTS},
        initial_slots=bytes(range(AGENTS)),
        boot=1,
        flight=bytes(8),
        datagram_key=b"",
    )
    said = list(frames())
    yield pack(make_tick(3, 9, 2, SensedPacker(rows).pack(0), range(len(said)), said))
    yield pack(make_tick(3, 9, -1, SensedPacker(empty_sensed(1)).pack(0)))
    yield made(Wait)
    yield made(Bye)
    yield made(Refused, process=7, why="no")


def vehicle_messages() -> Iterator[bytes]:
    x = (1.0, -2.0, 0.5)
    yield b"o" + pack_order(Order(Kind.FLY, 7, x, x, x, -3.0))
    yield b"a" + pack_account(
        Account(Mode.FOLLOW, 7, True, Ill.NO_LINK | Ill.LOCKED, x, x, 1.0, 0.1, 0.01, 0.9)
    )
    yield b"f" + pack_fix(x)


def air_messages() -> Iterator[bytes]:
    x = (1.0, -2.0, 0.5)
    yield b"b" + pack_beacon(Beacon(3, 4, 2, 77, 10**15, x, x, 12, 1, -3, 90, True), b"frame")
    yield b"w" + pack_word(Word(5, OperatorOrder.GO, 10**11, 10**15))
    yield (
        b"a"
        + AirAccount(
            3,
            "fly",
            "follow",
            ("it stands 1 m from its start",),
            ("start",),
            (0, 1),
            -0.5,
            2,
            100,
            1,
            0,
            "f",
            "m",
            "1",
        ).to_json()
    )


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


def pieces() -> Iterator[bytes]:
    yield b"|".join((*cut(b"ab" * 50, 1, 60), *cut(b"\x93gh", 2), *cut(b"ij" * 50, 3, 60)))
    yield b"|".join(cut(bytes(130_000), 4))


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
