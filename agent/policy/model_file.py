"""Model files of learned policies, and the note beside each that says what it is.

``mine.onnx`` is the model, ``mine.json`` its note: how it is flown, and the SHA-256 of the model (docs/policies.md). So whoever
forks drones can know all this without opening the model.
"""

import hashlib
import json
import os
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from agent.observation import WIDE_SIZE
from protocols.errors import SwarmError
from protocols.foreign_file import opened_file, read_file
from protocols.mission.document import explain
from protocols.wire.frames import OBSERVATION_SIZE
from protocols.wire.planned import LONGEST

FORMAT = "rsc-swarm-policy"
SHIPPED = Path(__file__).parent / "models"
Shapes = dict[str, tuple[int, ...]]  # a tensor's dimensions by its name; 0 is the number of drones


class ModelFileError(SwarmError, ValueError):
    """A file that holds no policy that can be flown; one line names the file and says why."""


class ModelNote(BaseModel):
    """What a note says: how the model is flown, to which file it belongs, and where that came from.

    horizon: ticks it plans. past: ticks it looks back. neighbours: of how many it can hear. aggregation: what it knows of them:
    what they said in the last ``past`` ticks, or means passed on over so many hops. replan: ticks from plan to plan.
    """

    model_config = ConfigDict(frozen=True)

    format: Literal["rsc-swarm-policy"]
    version: Literal["1"]
    features: Literal["1"] = Field(description="version of the observation")
    kind: Literal["rsc", "stgnn"]
    horizon: Annotated[int, Field(ge=1, le=LONGEST)]
    past: Annotated[int, Field(ge=1, le=100)]
    neighbours: Annotated[int, Field(ge=1, le=100)]
    aggregation: Literal["ticks", "hops"] = "ticks"
    extra: Literal["none", "wide"]
    output: Literal["knots", "raw", "action"]
    replan: Annotated[int, Field(ge=1)]
    network: Literal["1"] | None = Field(
        None, description="layout of a network that agent.policy.network computes; without, ONNX Runtime does"
    )
    heads: Annotated[int, Field(ge=1, le=64)] = Field(4, description="of its attention")
    sha256: str = Field(description="of the model file, hexadecimal")
    config: str = Field("", description="JSON of what it was trained with")
    seed: str = Field("", description="of its training")
    commit: str = Field("", description="of the code that trained it")

    @property
    def rounds(self) -> int:
        """Rounds of aggregation over the air (agent.relay)."""
        return self.past if self.aggregation == "hops" else 0

    @property
    def shapes(self) -> Shapes:
        """What the model takes and gives."""
        plan = (0, self.horizon, 2)
        said: Shapes = {
            "heard": (0, self.past, self.neighbours, OBSERVATION_SIZE),
            "share": (0, self.past, self.neighbours),
        }
        if self.rounds:
            said = {"means": (0, self.rounds, OBSERVATION_SIZE)}
        extra: Shapes = {"extra": (0, WIDE_SIZE)} if self.extra == "wide" else {}
        return {
            "own": (0, self.past, OBSERVATION_SIZE), **said, "target": (0, 2), **extra, "displacement": plan,
            "acceleration": plan,
        }  # fmt: skip


class Model(NamedTuple):
    """A model that has been found in order, with the bytes of its file."""

    path: Path
    facts: ModelNote
    data: bytes


@cache
def shipped_models() -> tuple[str, ...]:
    """Names of the models that come with the project."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.onnx")))


def note_of(path: Path) -> Path:
    """Where the note of a model file is."""
    return path.with_suffix(".json")


def read_model(path: Path) -> Model:
    """Read and check a model file and its note. Read once, it is kept: drones forked afterwards share its bytes.

    Raises:
        ModelFileError: one is missing or damaged, they do not belong together, or the note is foreign or of another version.
    """
    try:
        with opened_file(path) as file:
            status = os.fstat(file.fileno())
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    note = note_of(path)
    try:
        written = note.stat()
    except OSError:
        raise ModelFileError(
            f"{path}: its note {note.name} is not beside it; copy it too, or make it: {_describe(path)}"
        ) from None
    return _read(
        path.absolute(), (status.st_mtime_ns, status.st_size), (written.st_mtime_ns, written.st_size)
    )


@lru_cache(maxsize=4)
def _read(path: Path, _model: tuple[int, int], _note: tuple[int, int]) -> Model:
    note_path = note_of(path)
    try:
        data, text = read_file(path), read_file(note_path)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        note = parse_note(text)
    except ModelFileError as error:
        raise ModelFileError(f"{note_path}: {error}") from None
    if hashlib.sha256(data).hexdigest() != note.sha256:
        raise ModelFileError(
            f"{path}: is not the file that its note {note_path.name} was written for: damaged, cut off or exchanged; "
            f"copy both again, or make the note anew: {_describe(path)}"
        )
    return Model(path, note, data)


def parse_note(text: str | bytes) -> ModelNote:
    """A note from its JSON.

    Raises:
        ModelFileError: it is none, or of another version; the message does not name the file.
    """
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict) or fields.get("format") != FORMAT:
        raise ModelFileError(f"is no note of a policy: it lacks format = {FORMAT}")
    try:
        note = ModelNote.model_validate(fields)
    except ValidationError as error:
        raise ModelFileError(f"cannot be flown by this version: {explain(error)}") from None
    if note.replan > note.horizon:
        raise ModelFileError(f"replan: {note.replan} ticks, but it plans only {note.horizon}")
    return note


def _describe(path: Path) -> str:
    return f"python -m rsc_swarm.training.describe {path}"
