"""Model files of learned policies: what a file says of itself, read and checked without running it.

A model file is ONNX (docs/policies.md). Whoever forks drones must check it without opening it, so the few fields that
matter are picked out of the bytes here: metadata and the shapes of inputs and outputs. The weights stay unread.
"""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from agent.observation import WIDE_SIZE
from protocols.errors import SwarmError
from protocols.mission.document import explain
from protocols.wire.frames import OBSERVATION_SIZE

FORMAT = "rsc-swarm-policy"
SHIPPED = Path(__file__).parent / "models"
_Shapes = dict[str, tuple[int, ...]]  # a tensor's dimensions by its name; 0 is the number of drones

# Numbers of fields in ONNX's protobuf messages.
_GRAPH, _METADATA = 7, 14
_KEY, _VALUE = 1, 2
_INPUT, _OUTPUT = 11, 12
_NAME, _TYPE, _TENSOR, _SHAPE, _DIMENSION, _SIZE = 1, 2, 1, 2, 1, 1


class ModelFileError(SwarmError, ValueError):
    """A file that holds no policy that can be flown; one line names the file and says why."""


class ModelFacts(BaseModel):
    """What a model file says of itself: its metadata.

    horizon: ticks it plans. past: ticks it looks back. neighbours: of how many it can hear. replan: ticks from plan to plan.
    """

    model_config = ConfigDict(frozen=True)

    version: Literal["1"]
    features: Literal["1"] = Field(description="version of the observation")
    kind: Literal["rsc", "stgnn"]
    horizon: Annotated[int, Field(ge=1, le=1000)]
    past: Annotated[int, Field(ge=1, le=100)]
    neighbours: Annotated[int, Field(ge=1, le=100)]
    extra: Literal["none", "wide"]
    output: Literal["knots", "raw", "action"]
    replan: Annotated[int, Field(ge=1)]

    @property
    def shapes(self) -> _Shapes:
        """What the model takes and gives."""
        plan = (0, self.horizon, 2)
        shapes: _Shapes = {
            "own": (0, self.past, OBSERVATION_SIZE),
            "heard": (0, self.past, self.neighbours, OBSERVATION_SIZE),
            "share": (0, self.past, self.neighbours),
            "target": (0, 2),
            "displacement": plan,
            "acceleration": plan,
        }
        return {**shapes, "extra": (0, WIDE_SIZE)} if self.extra == "wide" else shapes


class Model(NamedTuple):
    """A model file that has been found in order, with its bytes."""

    path: Path
    facts: ModelFacts
    data: bytes


def shipped_models() -> list[str]:
    """Names of the models that come with the project."""
    return sorted(path.stem for path in SHIPPED.glob("*.onnx"))


def read_model(path: Path) -> Model:
    """Read and check a model file. Read once, it is kept: drones forked afterwards share its bytes.

    Raises:
        ModelFileError: it is missing, damaged, foreign, of another version, or its inputs and outputs are not as it says.
    """
    try:
        status = path.stat()
        return _read(path.absolute(), status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None


@lru_cache(maxsize=4)
def _read(path: Path, _mtime_ns: int, _size: int) -> Model:
    data = path.read_bytes()
    try:
        metadata, shapes = _contents(memoryview(data))
    except (ValueError, KeyError):  # UnicodeDecodeError is a ValueError
        raise ModelFileError("is damaged, cut off, or no ONNX file at all") from None
    if metadata.get("format") != FORMAT:
        raise ModelFileError(
            f"is an ONNX file but no policy of this project: its metadata lack format = {FORMAT}"
        )
    try:
        facts = ModelFacts.model_validate(metadata)
    except ValidationError as error:
        raise ModelFileError(f"cannot be flown by this version: {explain(error)}") from None
    if facts.replan > facts.horizon:
        raise ModelFileError(f"replan: {facts.replan} ticks, but it plans only {facts.horizon}")
    for name in sorted(facts.shapes.keys() | shapes.keys()):
        should, is_ = facts.shapes.get(name), shapes.get(name)
        if should != is_:
            raise ModelFileError(f"{name}: should be {_told(should)}, but is {_told(is_)}")
    return Model(path, facts, data)


def _told(shape: tuple[int, ...] | None) -> str:
    return "absent" if shape is None else f"({', '.join(str(size or 'B') for size in shape)})"


def _contents(model: memoryview) -> tuple[dict[str, str], _Shapes]:
    """Metadata, and the shapes of all inputs and outputs."""
    metadata: dict[str, str] = {}
    graph = None
    for field, value in _fields(model):
        if field == _METADATA:
            entry = dict(_fields(value))
            metadata[_text(entry[_KEY])] = _text(entry.get(_VALUE, memoryview(b"")))
        elif field == _GRAPH:
            graph = value
    if graph is None:
        raise ValueError("no graph")
    tensors = [dict(_fields(value)) for field, value in _fields(graph) if field in (_INPUT, _OUTPUT)]
    return metadata, {_text(tensor[_NAME]): _shape(tensor[_TYPE]) for tensor in tensors}


def _shape(kind: memoryview) -> tuple[int, ...]:
    tensor = dict(_fields(dict(_fields(kind))[_TENSOR]))
    sizes = [dict(_fields(size)) for field, size in _fields(tensor[_SHAPE]) if field == _DIMENSION]
    # A dimension without a number is named: any number of drones.
    return tuple(_varint(size[_SIZE], 0)[0] if _SIZE in size else 0 for size in sizes)


def _text(value: memoryview) -> str:
    return bytes(value).decode()


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Number and content of each field of a protobuf message.

    Raises:
        ValueError: it is no such message, or it ends in the middle of a field.
    """
    place = 0
    while place < len(message):
        key, place = _varint(message, place)
        wire = key & 7
        if wire == 0:
            end = _varint(message, place)[1]
        elif wire == 2:
            size, place = _varint(message, place)
            end = place + size
        elif wire in (1, 5):
            end = place + (8 if wire == 1 else 4)
        else:
            raise ValueError("no such kind of field")
        if end > len(message):
            raise ValueError("cut off")
        yield key >> 3, message[place:end]
        place = end


def _varint(message: memoryview, place: int) -> tuple[int, int]:
    """The number that begins at ``place``, and the place after it."""
    number = shift = 0
    while place < len(message) and shift < 64:
        byte = message[place]
        number |= (byte & 0x7F) << shift
        place, shift = place + 1, shift + 7
        if byte < 0x80:
            return number, place
    raise ValueError("cut off")
