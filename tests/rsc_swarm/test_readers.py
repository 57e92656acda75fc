"""What is read back from files may be anything: it is understood, skipped, or refused in one line that names the file."""

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.policy.model_file import ModelFileError, read_model
from protocols.fleet.document import FleetError, read_fleet
from protocols.foreign_file import read_file
from protocols.mission.document import Mission
from protocols.mission.fields import Obstacles
from protocols.wire.certificates import read_login
from protocols.wire.login import Login
from rsc_swarm.flight import key_files
from rsc_swarm.show.plots.curves import read_curve
from rsc_swarm.show.plots.style import PlotError
from rsc_swarm.study.evaluate import summarise
from rsc_swarm.study.finished import FinishedFlights, FinishedFlightsError
from rsc_swarm.study.tables.markdown import markdown
from rsc_swarm.study.tables.result import TableError, read_table
from rsc_swarm.study.workers import fly_batch

RESULTS = Path(__file__).parents[2] / "docs" / "results"
MISSION = Mission(
    agents=1, fly_s=0.05, obstacles=Obstacles(discs=())
)  # so that it is infinitely far from anything

NASTY = [
    b"null", b"true", b"-1", b"1e999", b"-1e999", b"NaN", b"1" * 5000, b'"\\ud800"', b'"\xff"', b"{}", b"[]", b"[[]]",
    b"[" * 100_000, b'{"a":' * 5000, b"\x00", b"", b'"1"', b"1.5",
]  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, good: bytes) -> bytes:
    """A file's content with one thing wrong: a value replaced, a piece lost, something else altogether."""
    kind = draw(st.sampled_from(["value", "cut", "piece", "nonsense", "nasty"]))
    if kind == "nonsense":
        return draw(st.binary(max_size=60))
    if kind == "nasty":
        return draw(st.sampled_from(NASTY))
    at = draw(st.integers(0, len(good) - 1))
    if kind == "cut":
        return good[:at]
    if kind == "piece":
        return good[:at] + draw(st.binary(max_size=5)) + good[at + draw(st.integers(0, 20)) :]
    begin = good.find(b": ", at) + 2 or 1
    ends = [end for mark in (b",", b"}", b"\n") if (end := good.find(mark, begin)) > 0]
    return good[:begin] + draw(st.sampled_from(NASTY)) + good[min(ends, default=len(good)) :]


def journal_line() -> bytes:
    with TemporaryDirectory() as folder, FinishedFlights(Path(folder) / "journal") as book:
        for said in fly_batch(MISSION, [(3, 5)]):
            if not isinstance(said, int):
                book.add(said)
        return book.path.read_bytes()


JOURNAL = journal_line()
LOGIN = Login("rsc", 3, "secret").to_json().encode()
TABLE = (RESULTS / "table-slots.json").read_bytes()
CURVE = b'{"updates": 100, "loss": 0.5, "success": null}\n{"updates": 200, "loss": NaN}\n'


def read_journal(path: Path) -> None:
    with FinishedFlights(path) as book:
        if book.finished:
            summarise(MISSION, list(book.finished.values()), 1, "")


READERS: dict[str, tuple[Callable[[Path], Any], bytes, type[Exception]]] = {
    "journal.jsonl": (read_journal, JOURNAL, FinishedFlightsError),
    "table-slots.json": (lambda path: markdown(read_table(path)), TABLE, TableError),
    "curve.jsonl": (lambda path: read_curve(path.parent), CURVE, PlotError),
}


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
def test_no_content_is_more_than_one_line_of_trouble(name: str, data: st.DataObject) -> None:
    read, good, refusal = READERS[name]
    content = data.draw(damaged(good))
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        told = None
        try:
            read(path)
        except refusal as error:
            told = str(error)
        assert told is None or (str(path) in told and "\n" not in told)


@pytest.mark.parametrize("name", READERS)
def test_what_was_written_here_is_read(name: str, tmp_path: Path) -> None:
    read, good, _ = READERS[name]
    (tmp_path / name).write_bytes(good)
    read(tmp_path / name)


@given(damaged(LOGIN))
def test_a_login_is_one_or_it_is_refused(content: bytes) -> None:
    with suppress(ValueError):
        login = read_login(content.decode(errors="replace"))
        assert read_login(login.to_json()) == login
        assert type(login.agent) is int


@pytest.mark.parametrize(
    "content", [b"\xff", b"null", b"[" * 100_000, b'{"swarm": null, "agent": 1e999, "password": ""}']
)
def test_a_login_file_that_is_none_is_named(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "agent-3.json"
    path.write_bytes(content)
    with pytest.raises(key_files.KeyFileError) as told:
        key_files.read_login(path, 3, "tcp/localhost:1", plain_text=False)
    assert str(told.value).startswith(f"{path}: ")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("garbage", NASTY)
def test_a_journal_keeps_what_is_good_beside_what_is_not(garbage: bytes, tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    text = json.loads(JOURNAL)
    wrong = [
        {**text, "map_seed": 9, "swaps": {}},
        {**text, "map_seed": "9"},
    ]
    path.write_bytes(b"\n".join([garbage, *(json.dumps(line).encode() for line in wrong), JOURNAL.strip()]))
    with FinishedFlights(path) as book:
        assert set(book.finished) == {(3, 5)}


def test_a_journal_that_cannot_be_had_is_named(tmp_path: Path) -> None:
    with pytest.raises(FinishedFlightsError, match=rf"^{tmp_path}: cannot be written \(Is a directory\)"):
        FinishedFlights(tmp_path)


def test_what_never_ends_is_refused(tmp_path: Path) -> None:
    for name in ("curve.jsonl", "table.json", "journal.jsonl"):
        (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(PlotError, match=r"curve.jsonl: cannot be read \(it is no file\)"):
        read_curve(tmp_path)
    with pytest.raises(TableError, match=r"table.json: cannot be read \(it is no file\)"):
        read_table(tmp_path / "table.json")
    with pytest.raises(FinishedFlightsError, match=r"journal.jsonl: is no file"):
        FinishedFlights(tmp_path / "journal.jsonl")


def test_nobody_waits_for_what_a_pipe_may_bring(tmp_path: Path) -> None:
    """Nobody writes into it, and so a command hung."""
    for name in ("fleet.yaml", "agent-0.json", "model.onnx"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(FleetError, match=r"fleet.yaml: cannot be read \(it is no file\)"):
        read_fleet(tmp_path / "fleet.yaml")
    with pytest.raises(key_files.KeyFileError, match=r"agent-0.json: cannot be read \(it is no file\)"):
        key_files.read_login(tmp_path / "agent-0.json", 0, "tls/a:1", plain_text=False)
    with pytest.raises(ModelFileError, match=r"model.onnx: cannot be read \(it is no file\)"):
        read_model(tmp_path / "model.onnx")


def test_a_long_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    with (tmp_path / "long").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(OSError, match="it is longer than 2 MiB"):
        read_file(tmp_path / "long", 2 << 20)
