"""All that reads bytes from outside: what a target is given it reads, or refuses with an error of its own.

The branches of a target's ``decoders`` are counted, so that a corpus can be judged by what it reaches.
"""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from agent.policy import model_file, weights
from agent.policy.model_file import ModelFileError
from agent.radio import hearing
from agent.radio.air import Air
from protocols.errors import SwarmError
from protocols.fleet import document as fleet_document
from protocols.fleet import plan
from protocols.fleet.document import FleetError
from protocols.mission import (
    checks,
    document,
    fault,
    findings,
    policy_name,
    reading,
    values,
)
from protocols.mission.document import MissionError, read_mission_fields
from protocols.slots import notes
from protocols.wire import (
    account,
    beacon,
    certificates,
    endpoints,
    frames,
    heard,
    keys,
    login,
    messages,
    nature,
    operator,
    pieces,
    status,
    vehicles,
)
from protocols.wire.account import AccountError
from protocols.wire.beacon import BeaconError
from protocols.wire.login import Login
from protocols.wire.messages import MessageError
from protocols.wire.nature import NatureError
from protocols.wire.operator import OperatorError
from protocols.wire.vehicles import VehicleMessageError
from rsc_swarm import options
from rsc_swarm.flight.run_dir import RunDir, RunDirError
from rsc_swarm.selfcheck.trials import FinishedTrials
from rsc_swarm.show.plots import curves
from rsc_swarm.show.plots.style import PlotError
from rsc_swarm.study import finished
from rsc_swarm.study.finished import FinishedFlightsError
from rsc_swarm.study.tables import result
from rsc_swarm.study.tables.result import TableError, as_csv, read_table
from rsc_swarm.training.config import TrainingConfig, TrainingError, make_config
from rsc_swarm.watch import hands
from rsc_swarm.watch.hands import HandError
from tests.fuzz import mutate, readers, seed_files, seed_messages
from tests.fuzz.mutate import Change
from world import faults
from world.outlets import trajectory
from world.outlets.trajectory import TrajectoryError
from world.server.credentials import Credentials


class Target(NamedTuple):
    """``read`` is given bytes and raises nothing but ``refusals``, or, where there are none, nothing at all.

    seeds: valid inputs. change: how one gets something wrong into it. decoders: functions, classes and modules whose
    branches count; none where a library decodes.
    """

    read: Callable[[bytes], object]
    refusals: tuple[type[Exception], ...]
    seeds: Callable[[], Iterable[bytes]]
    change: Change
    decoders: tuple[Any, ...]


def is_declared(target: Target, error: Exception) -> bool:
    """Whether an error is one that the target may raise, and one line."""
    return isinstance(error, target.refusals) and "\n" not in str(error)


TARGETS = {
    "frame": Target(
        readers.read_frame, (), seed_messages.frames, mutate.bytes_changed, (frames.read_frame, frames.fault)
    ),
    "heard": Target(
        readers.read_heard,
        (),
        seed_messages.heard,
        mutate.bytes_changed,
        (hearing.entry_end, hearing.hear_entry, hearing.Hearing, Air.read_note, heard.unpack_heard),
    ),
    "note": Target(
        readers.read_note,
        (ValueError,),
        seed_messages.notes,
        mutate.msgpack_changed,
        (
            notes.decode,
            notes._int,
            notes._agents,
            notes._seals,
            notes._list,
            notes._ints,
            notes._maybe,
            notes._several,
        ),
    ),
    "status": Target(
        readers.read_status,
        (ValueError,),
        seed_messages.statuses,
        mutate.msgpack_changed,
        (status.parse_status,),
    ),
    "from-drone": Target(
        readers.read_from_drone,
        (MessageError,),
        seed_messages.from_drone,
        mutate.message_changed,
        (
            messages.unpack_from_drone,
            messages._unpack,
            messages._unpack_reply,
            messages._msgpack,
            messages._whole,
            messages._status,
            status.parse_status,
        ),
    ),
    "from-world": Target(
        readers.read_from_world,
        (MessageError, MissionError),
        seed_messages.from_world,
        mutate.message_changed,
        (messages.unpack_from_world, messages._unpack, messages._unpack_tick, messages._typed),
    ),
    "vehicle": Target(
        readers.read_vehicle,
        (VehicleMessageError,),
        seed_messages.vehicle_messages,
        mutate.bytes_changed,
        (
            vehicles.unpack_order,
            vehicles.unpack_account,
            vehicles.unpack_fix,
            vehicles._unpack,
            vehicles._checked,
        ),
    ),
    "on-air": Target(
        readers.read_air_message,
        (BeaconError, OperatorError, AccountError, NatureError),
        seed_messages.air_messages,
        mutate.bytes_changed,
        (beacon.unpack_beacon, operator.unpack_word, account.read_account, nature),
    ),
    "hand": Target(
        readers.read_hand,
        (HandError, MissionError),
        seed_messages.hands,
        mutate.json_changed,
        (hands.read_hand, faults.with_fault),
    ),
    "fleet": Target(
        readers.in_file("fleet.yaml", readers.read_fleet_file),
        (FleetError,),
        seed_files.fleets,
        mutate.yaml_changed,
        (fleet_document, plan),
    ),
    "pieces": Target(readers.read_pieces, (), seed_messages.pieces, mutate.bytes_changed, (pieces,)),
    "login": Target(
        readers.read_login,
        (ValueError,),
        seed_files.logins,
        mutate.json_changed,
        (
            Login.from_json,
            login.from_json,
            keys.checked_swarm,
            keys.checked_agent,
            certificates.read_login,
            certificates.checked_certificates,
            certificates.refuse_out_of_date,
            certificates._read,
        ),
    ),
    "world-keys": Target(
        readers.read_world_keys,
        (ValueError,),
        seed_files.world_keys,
        mutate.json_changed,
        (Credentials.from_json, certificates.checked_certificates, certificates.refuse_other_address),
    ),
    "mission": Target(
        readers.in_file("mission.yaml", readers.read_mission),
        (MissionError,),
        seed_files.missions,
        mutate.yaml_changed,
        (reading, document, checks, fault, values, findings, read_mission_fields),
    ),
    "options": Target(
        readers.read_options,
        (MissionError,),
        seed_files.settings,
        mutate.bytes_changed,
        (options.resolve, options._setting, options._put),
    ),
    "words": Target(
        readers.read_words,
        (SwarmError, ValueError),
        seed_files.words,
        mutate.bytes_changed,
        (keys.checked_swarm, endpoints, policy_name),
    ),
    "model-note": Target(
        readers.in_file("model.json", readers.read_model),
        (ModelFileError,),
        seed_files.model_notes,
        mutate.json_changed,
        (model_file._read, model_file.parse_note, model_file.ModelNote.shapes),
    ),
    "weights": Target(
        weights.tensors_in, (ModelFileError,), seed_files.models, mutate.bytes_changed, (weights,)
    ),
    "journal": Target(
        readers.in_file("journal.jsonl", readers.read_journal),
        (FinishedFlightsError,),
        seed_files.journals,
        mutate.lines_changed,
        (finished.Journal, finished.FinishedFlights, FinishedTrials),
    ),
    "table": Target(
        readers.in_file("table-1.json", readers.read_result),
        (TableError,),
        seed_files.tables,
        mutate.json_changed,
        (read_table, as_csv, result._flat, result._known),
    ),
    "report": Target(
        readers.in_file("report.json", readers.read_report),
        (RunDirError,),
        seed_files.reports,
        mutate.json_changed,
        (RunDir.told,),
    ),
    "recording": Target(
        readers.in_file("trajectory.npz", readers.read_recording),
        (TrajectoryError,),
        seed_files.recordings,
        mutate.zip_changed,
        (trajectory,),
    ),
    "curve": Target(
        readers.in_file("curve.jsonl", readers.read_curve),
        (PlotError,),
        seed_files.curves,
        mutate.lines_changed,
        (curves.read_curve,),
    ),
    "training": Target(
        readers.in_file("training.yaml", readers.read_training),
        (TrainingError,),
        seed_files.trainings,
        mutate.yaml_changed,
        (make_config, TrainingConfig),
    ),
    "checkpoint": Target(
        readers.read_checkpoint, (TrainingError,), seed_files.checkpoints, mutate.zip_changed, ()
    ),
    "model": Target(readers.run_model, (RuntimeError,), seed_files.models, mutate.bytes_changed, ()),
    "description": Target(
        readers.in_file("model.onnx", readers.describe_model),
        (ModelFileError,),
        seed_files.models,
        mutate.bytes_changed,
        (),
    ),
}
