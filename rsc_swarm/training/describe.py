"""Write the note of a model file from the metadata inside it: ``python -m rsc_swarm.training.describe mine.onnx``.

Whoever only flies needs none of this; it takes the ``onnx`` package.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import onnx
from google.protobuf.message import DecodeError

from agent.policy.learned_kernel import empty_question
from agent.policy.model_file import ModelFileError, ModelNote, Shapes, note_of, parse_note
from agent.policy.network import Network
from agent.policy.session import Session
from protocols.errors import ExitCode, SwarmError
from protocols.foreign_file import read_file
from protocols.printable import printable
from protocols.whole_file import write_whole

_ASKED, _TOLERANCE = 5, 1e-4


def describe(path: Path) -> ModelNote:
    """Check the model file ``path`` and write its note beside it.

    Raises:
        ModelFileError: it is missing, no policy of this project, or its inputs and outputs are not as its metadata say.
        protocols.whole_file.WriteError: the note cannot be written.
    """
    try:
        data = read_file(path)
        document = onnx.load_from_string(data)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    except DecodeError:
        raise ModelFileError(f"{path}: is damaged, cut off, or no ONNX file at all") from None
    metadata = {_text(entry.key): _text(entry.value) for entry in document.metadata_props}
    try:
        note = parse_note(json.dumps({**metadata, "sha256": hashlib.sha256(data).hexdigest()}))
        _compare(note.shapes, _shapes(document))
        if note.network:
            _compare_plans(note, data)
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None
    write_whole(note_of(path), note.model_dump_json(indent=1, exclude_unset=True) + "\n")
    return note


def _shapes(document: onnx.ModelProto) -> Shapes:
    """Of all inputs and outputs; a dimension without a number is named: any number of drones."""
    tensors = [*document.graph.input, *document.graph.output]
    return {
        _text(tensor.name): tuple(size.dim_value for size in tensor.type.tensor_type.shape.dim)
        for tensor in tensors
    }


def _text(value: str | bytes) -> str:
    """What protobuf read, which is bytes where it is no UTF-8."""
    return value if isinstance(value, str) else value.decode(errors="backslashreplace")


def _compare(wanted: Shapes, given: Shapes) -> None:
    for name in sorted(wanted.keys() | given.keys()):
        should, is_ = wanted.get(name), given.get(name)
        if should != is_:
            raise ModelFileError(f"{printable(name)}: should be {_told(should)}, but is {_told(is_)}")


def _compare_plans(note: ModelNote, data: bytes) -> None:
    """A network of ours is computed from its tensors: the file's own graph must come to the same."""
    draw, plans = np.random.default_rng(0), []
    asked = empty_question(_ASKED, note.past, 0 if note.rounds else note.neighbours, note.rounds)
    for numbers in (asked.own, asked.heard, asked.share, asked.means, asked.target, asked.extra):
        numbers[:] = draw.random(numbers.shape)
    try:
        for model in (Network(note, data), Session(note, data)):
            plan = np.zeros((2, _ASKED, note.horizon, 2), np.float32)
            model.plan(0, _ASKED, asked, *plan)
            plans.append(plan)
    except (ModelFileError, RuntimeError) as error:
        raise ModelFileError(f"cannot be run ({error})") from None
    off = float(np.abs(plans[0] - plans[1]).max())
    if not off <= _TOLERANCE * max(1.0, float(np.abs(plans[1]).max())):
        raise ModelFileError(
            f"network: its graph is not that of such a network: plans differ by {off:.1e}; leave out network and heads"
        )


def _told(shape: tuple[int, ...] | None) -> str:
    return "absent" if shape is None else f"({', '.join(str(size or 'B') for size in shape)})"


def main() -> None:
    """Describe the files named on the command line."""
    names = sys.argv[1:]
    try:
        if not names:
            raise ModelFileError("name the model files: python -m rsc_swarm.training.describe mine.onnx")
        for name in names:
            note = describe(Path(name))
            print(f"{note_of(Path(name))}: {note.kind}, plans {note.horizon} ticks")
    except SwarmError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
    sys.exit(ExitCode.SUCCEEDED)


if __name__ == "__main__":
    main()
