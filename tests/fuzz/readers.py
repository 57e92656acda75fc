"""The readers that are fuzzed, as functions of bytes.

Each also looks at what was read: it is written again and must then be read as the same, or what uses it must bear it.
"""

import atexit
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zlib import crc32

import msgpack
import numpy as np

from agent.body.relayed import RelayedWorld
from agent.policy import find_policy, model_file
from agent.ports import Heard, heard_of
from agent.radio.air import Air
from agent.radio.hearing import Hearing
from protocols.mission import policy_name, reading
from protocols.mission.document import mission_yaml, parse_briefing, parse_mission, read_mission_fields
from protocols.slots import notes
from protocols.wire import (
    account,
    beacon,
    certificates,
    endpoints,
    frames,
    keys,
    messages,
    nature,
    operator,
    pieces,
    status,
    vehicles,
)
from protocols.wire.heard import unpack_heard
from protocols.wire.keys import LinkError
from rsc_swarm import options
from rsc_swarm.air.plans import read_plan
from rsc_swarm.flight.run_dir import RunDir
from rsc_swarm.missions import shipped_missions
from rsc_swarm.selfcheck.trials import FinishedTrials
from rsc_swarm.show.plots import curves
from rsc_swarm.study.evaluate import summarise
from rsc_swarm.study.finished import FinishedFlights
from rsc_swarm.study.tables.markdown import markdown
from rsc_swarm.study.tables.result import as_csv, read_table
from rsc_swarm.training.config import TrainingConfig, make_config
from rsc_swarm.watch import hands
from tests.fuzz import seed_files
from tests.fuzz.seed_messages import AGENTS, NOW
from tests.parts import times_of
from world.faults import with_fault
from world.outlets.trajectory import Trajectory
from world.server.credentials import Credentials

# --- what comes over the air and the wire ------------------------------------------------------------------------------------

_AIR = Air("rsc", AGENTS, messages.MAX_HEARD + 1)
_EARS = Hearing(_AIR, AGENTS, AGENTS)
_WORLD = RelayedWorld(7)


def read_frame(data: bytes) -> None:
    place = frames.FIXED.fields["sender"][1]
    said = [(int.from_bytes(data[place : place + 2], "little"), data)]
    before = sum(_EARS.rejected.values())
    if _EARS.hear(NOW, heard_of(said)):
        row = int(_EARS.believed[0])
        note, again = _AIR.note(row), _AIR.pack(row)
        assert _EARS.hear(NOW, heard_of([(said[0][0], again)])) == 1
        assert _AIR.note(row) == note
    else:
        assert sum(_EARS.rejected.values()) == before + 1


def read_heard(data: bytes) -> None:
    """The first byte says how many frames there are to be."""
    if data:
        count = _EARS.hear(NOW, Heard(np.frombuffer(data, np.uint8), 1, len(data), data[0]))
        assert 0 <= count <= data[0]
        assert len(list(unpack_heard(data[1:], data[0]))) >= count


def _unpacked(data: bytes) -> Any:
    """As the frame or message around it has been read."""
    try:
        return msgpack.unpackb(data)
    except (ValueError, TypeError, msgpack.exceptions.UnpackException):
        raise ValueError("not msgpack") from None


def read_note(data: bytes) -> None:
    said = notes.decode(_unpacked(data), AGENTS)
    assert notes.decode(msgpack.unpackb(msgpack.packb(notes.encode(said))), AGENTS) == said


def read_status(data: bytes) -> None:
    said = status.parse_status(_unpacked(data), AGENTS)
    assert status.parse_status(msgpack.unpackb(msgpack.packb(said)), AGENTS) == said


def read_from_drone(data: bytes) -> None:
    said = messages.unpack_from_drone(data, AGENTS)
    assert messages.unpack_from_drone(messages.pack(said), AGENTS) == said


def read_from_world(data: bytes) -> None:
    said = messages.unpack_from_world(data)
    messages.pack(said)
    if isinstance(said, messages.Tick):
        _WORLD.take(said)
        _WORLD.sense()
        _EARS.hear(NOW, _WORLD.hear())
    if isinstance(said, messages.Welcome):
        parse_briefing(said.briefing, "analytic")


_VEHICLE_MESSAGES = {
    b"o": (vehicles.unpack_order, vehicles.pack_order),
    b"a": (vehicles.unpack_account, vehicles.pack_account),
    b"f": (vehicles.unpack_fix, vehicles.pack_fix),
}


_AIR_MESSAGES: dict[bytes, Any] = {
    b"b": (beacon.unpack_beacon, lambda said: beacon.pack_beacon(*said)),
    b"w": (operator.unpack_word, operator.pack_word),
    b"a": (account.read_account, account.Account.to_json),
    b"n": (nature.unpack_nature, nature.pack_nature),
    b"s": (lambda data: nature.unpack_status(data, AGENTS), nature.pack_status),
}


def read_air_message(data: bytes) -> None:
    """The first letter says which message it is to be."""
    read, write = _AIR_MESSAGES.get(data[:1], _AIR_MESSAGES[b"b"])
    said = read(data[1:])
    assert read(write(said)) == said


def read_hand(data: bytes) -> None:
    """What a page says that somebody wants, and what becomes of it in a flight."""
    hand = hands.read_hand(data)
    if hand.fault is not None:
        flown = with_fault(parse_mission({"agents": AGENTS}), {"at_s": 0.5, **hand.fault})
        assert parse_mission(flown.model_dump(mode="json")) == flown


def read_fleet_file(path: Path) -> None:
    read_plan(path)


def read_vehicle(data: bytes) -> None:
    """The first letter says which message it is to be."""
    unpack, pack = _VEHICLE_MESSAGES.get(data[:1], _VEHICLE_MESSAGES[b"o"])
    said = unpack(data[1:])
    assert unpack(pack(said)) == said  # type: ignore[operator]


def read_pieces(data: bytes) -> None:
    joiner = pieces.Joiner(longest=100)
    for piece in data.split(b"|"):
        joiner.join(piece)
        assert joiner._bytes <= 100
    joiner = pieces.Joiner()
    for piece in pieces.cut(data, len(data)):
        whole = joiner.join(piece)
    assert whole == data


def read_login(data: bytes) -> None:
    login = certificates.read_login(data.decode("utf-8"))
    assert certificates.read_login(login.to_json()) == login
    if login.certificates:
        certificates.refuse_out_of_date(login.certificates, seed_files.TODAY)


def read_world_keys(data: bytes) -> None:
    keys_of_all = Credentials.from_json(data.decode("utf-8"))
    assert Credentials.from_json(keys_of_all.to_json()) == keys_of_all
    if keys_of_all.certificates:
        certificates.refuse_out_of_date(keys_of_all.certificates, seed_files.TODAY)
        certificates.refuse_other_address(keys_of_all.certificates, seed_files.ADDRESS)


# --- what people write -------------------------------------------------------------------------------------------------------


@cache
def _folder() -> Path:
    """A folder of this process's own, in memory where there is such a place."""
    made = TemporaryDirectory(
        dir=os.environ.get("TMPDIR") or ("/dev/shm" if Path("/dev/shm").is_dir() else None)
    )
    atexit.register(made.cleanup)
    return Path(made.name)


def in_file(name: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    """``read`` of a file of this name that holds the bytes."""

    def run(data: bytes) -> None:
        path = _folder() / name
        path.write_bytes(data)
        read(path)

    return run


def read_mission(path: Path) -> None:
    mission = parse_mission(read_mission_fields(path), str(path))
    if crc32(path.read_bytes()) % 16 == 0:  # it takes long
        assert parse_mission(reading.read_yaml(mission_yaml(mission))) == mission
    assert min(times_of(mission)) > 0


def read_options(data: bytes) -> None:
    """The first line comes after ``--mission`` if it names one that is shipped; all others are words after ``--set``."""
    first, *others = data.decode("utf-8", "surrogateescape").split("\n")
    words = others if first in shipped_missions() else [first, *others]
    given = options.MissionOptions(
        mission=None if words[:1] == [first] else first, set=words, loss=0.1 if len(words) > 5 else None
    )
    options.resolve(given)
    options.command_line("launch", given)


def read_words(data: bytes) -> None:
    """Names that a command is given: of a swarm, a world's address, and a policy, but for those that would be imported."""
    swarm, endpoint, policy = [*data.decode("utf-8", "surrogateescape").split("\n", 2), "", ""][:3]
    keys.checked_swarm(swarm)
    endpoints.checked_endpoint(endpoint)
    with suppress(LinkError):
        endpoints.refuse_plain_text(endpoint)
    mission = parse_mission({"agents": 3, "policy": policy})
    name = policy_name.split(policy)[1]
    if not name or policy_name.file_of(policy):
        find_policy(policy_name.from_folder(policy, _folder()), mission)


# --- what was written to files before ----------------------------------------------------------------------------------------


def read_model(path: Path) -> None:
    """A note, beside the model it was written for."""
    model = path.with_suffix(".onnx")
    model.write_bytes(seed_files.MODEL)
    _ = model_file._read.__wrapped__(model, (0, 0), (0, 0)).facts.shapes


def read_journal(path: Path) -> None:
    with FinishedFlights(path) as book:
        if book.finished:
            summarise(seed_files.FLOWN, list(book.finished.values()), 1, "")
    with FinishedTrials(path):
        pass


def read_result(path: Path) -> None:
    table = read_table(path)
    markdown(table)
    as_csv(table)


def read_report(path: Path) -> None:
    if not path.read_bytes():
        path.unlink()
    RunDir(path.parent).told()


def read_recording(path: Path) -> None:
    flown = Trajectory.load(path)
    moments, drones, _ = flown.positions.shape
    assert flown.velocities.shape == (moments, drones, 2)
    assert flown.slots.shape == flown.flying.shape == (moments, drones)
    assert flown.obstacles.shape[1:] == (3,)
    assert len(flown.times) == moments


def read_training(path: Path) -> None:
    """A comment in the first line names the preset."""
    first = path.read_text(encoding="utf-8", errors="replace").partition("\n")[0]
    config = make_config(first[2:] if first.startswith("# ") else "default", path)
    assert TrainingConfig.model_validate_json(config.model_dump_json()) == config


def read_checkpoint(data: bytes) -> None:
    from rsc_swarm.training.checkpoint import TrainingFolder  # takes torch

    folder = TrainingFolder(_folder() / "training", TrainingConfig())
    (folder.path / "checkpoint.pt").write_bytes(data)
    folder.load()


def run_model(data: bytes) -> None:
    from agent.policy.session import open_session

    open_session(data)


def describe_model(path: Path) -> None:
    from rsc_swarm.training.describe import describe

    describe(path)


def read_curve(path: Path) -> None:
    curves.read_curve(path.parent)
