"""YAML as people mean it, and any text whatever: a mission, or one line that says why not."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocols.mission.document import (
    Mission,
    MissionError,
    mission_yaml,
    parse_mission,
    read_mission_fields,
)
from protocols.mission.reading import MAX_BYTES, ReadingError, read_yaml, write_yaml
from tests.parts import times_of
from tests.protocols.test_mission import refusal


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("25", 25), ("+5", 5), ("-0.5", -0.5), ("1e5", 1e5), (".5", 0.5), ("1.", 1.0), ("true", True), ("False", False),
        ("null", None), ("~", None), ("", None), ("[1, 2]", [1, 2]), ("{a: 1}", {"a": 1}), ("'25'", "25"),
        ("yes", "yes"), ("on", "on"), ("off", "off"), ("NO", "NO"), ("y", "y"), ("12:34", "12:34"), ("1_000", "1_000"),
        ("2024-01-01", "2024-01-01"), ("0x1F", "0x1F"), ("0o17", "0o17"), ("=", "="),
    ],
)  # fmt: skip
def test_a_value_is_what_it_looks_like(text: str, value: object) -> None:
    read = read_yaml(text)
    assert (read, type(read)) == (value, type(value))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a: 1\nb: 2\na: 3", "is not valid YAML at line 3, column 1 ('a' is written twice, before in line 1; keep one)"),
        ("a: {b: 1, b: 2}", "is not valid YAML at line 1, column 11 ('b' is written twice, before in line 1; keep one)"),
        ("a: 010", "is not valid YAML at line 1, column 4 (010: a number with a leading zero; leave it out, or"),
        ("a: 00.5", "is not valid YAML at line 1, column 4 (00.5: a number with a leading zero"),
        ("a: 1e999", "is not valid YAML at line 1, column 4 (1e999: is too large for a number)"),
        ("a: " + "9" * 5000, "is not valid YAML at line 1, column 4 (a number of 5000 digits is too long)"),
        ("[" * 1000, "is not valid YAML at line 1, column 17 (nested deeper than 16 levels)"),
        ("{a: " * 1000, "is not valid YAML at line 1, column 65 (nested deeper than 16 levels)"),
        ("- " * 1000, "is not valid YAML at line 1, column 33 (nested deeper than 16 levels)"),
        ("a: &x [1]\nb: [*x, *x]", "is not valid YAML at line 1, column 4 (anchors and aliases are not read; write the"),
        ("a: *x", "is not valid YAML at line 1, column 4 (anchors and aliases are not read"),
        ("a: !!python/object:os.system x", "is not valid YAML at line 1, column 4 (the tag tag:yaml.org,2002:python/object"),
        ("a: !!binary x", "is not valid YAML at line 1, column 4 (the tag tag:yaml.org,2002:binary is not read"),
        ("a:\n\t- 1", "is not valid YAML at line 2, column 1 (found character '\\t' that cannot start any token; indent with"),
        ("1: 2", "is not valid YAML at line 1, column 1 ('1' is no name of a field; if it is meant as one, put it in quotes)"),
        ("null: 2", "is not valid YAML at line 1, column 1 ('null' is no name of a field"),
        ("[1]: 2", "is not valid YAML at line 1, column 1 (a list or mapping is no name of a field"),
        ("a: 1\n---\na: 2", "is not valid YAML at line 2, column 1 (but found another document)"),
        ("a: \x00", "is not text: character 3 is #x0000"),
        ("a" * (MAX_BYTES + 1), "is longer than 64 KiB"),
    ],
)  # fmt: skip
def test_what_could_be_meant_in_two_ways_is_refused_with_its_place(text: str, line: str) -> None:
    with pytest.raises(ReadingError) as refused:
        read_yaml(text)
    assert str(refused.value).startswith(line)
    assert "\n" not in str(refused.value)


@given(st.text())
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    refused = ""
    try:
        read_yaml(text)
    except ReadingError as error:
        refused = str(error)
    assert "\n" not in refused


LEAVES = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | st.floats(allow_nan=False) | st.text()
FIELDS = st.dictionaries(
    st.text(),
    st.recursive(
        LEAVES,
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
        max_leaves=5,
    ),
    max_size=4,
)


@given(FIELDS)
def test_what_is_written_is_read_back(fields: dict[str, Any]) -> None:
    assert read_yaml(write_yaml(fields)) == fields


def test_a_mission_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    def complaint(content: bytes) -> str:
        path = tmp_path / "m.yaml"
        path.write_bytes(content)
        with pytest.raises(MissionError) as caught:
            read_mission_fields(path)
        assert "\n" not in str(caught.value)
        return str(caught.value).removeprefix(f"{path}: ")

    assert complaint(b"- 1\n- 2\n").startswith("must be a mapping of fields such as 'agents: 25', not a list")
    assert complaint(b"agents: [1\nname: x").startswith("is not valid YAML at line 2")
    assert complaint(b"\xff\xfe\x00").startswith("is not UTF-8 text")
    assert complaint(b"agents: 4\n" * 100_000) == "cannot be read (it is longer than 64 KiB)"
    # Fewer letters than bytes, cut between two and within one.
    for umlauts in (MAX_BYTES // 2, MAX_BYTES // 2 + 1):
        long = f"agents: 4\n#{'ü' * umlauts}\nseed: 3\n".encode()
        assert complaint(long) == "cannot be read (it is longer than 64 KiB)", "the rest of it was left out"
        assert complaint(b"#" + long) == "cannot be read (it is longer than 64 KiB)"
    with pytest.raises(MissionError, match="cannot be read"):
        read_mission_fields(tmp_path / "nowhere.yaml")
    with pytest.raises(MissionError, match="cannot be read"):
        read_mission_fields(tmp_path)


@pytest.mark.parametrize("text", ["", "# nothing\n", "---\n", "~", "{}", "\ufeff"])
def test_a_mission_file_may_be_empty(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    assert read_mission_fields(path) == {}


def _fields_of(section: dict[str, Any], place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    for name, value in section.items():
        yield (*place, name)
        if isinstance(value, dict):
            yield from _fields_of(value, (*place, name))


PLACES = list(_fields_of(Mission().model_dump(mode="json")))
NUMBERS = (
    st.sampled_from([0, 1, -1, 2, 0.01, 0.5, 1e-9, 1e6, 1e300, 2**32, 10**30, 21.0, 100])
    | st.integers()
    | st.floats()
)
WHO = st.lists(NUMBERS, max_size=2)
KINDS = st.sampled_from(
    ["kill", "freeze", "thaw", "restart", "part", "heal", "slow", "recover", "lie", "truth", "x"]
)
GROUPS = st.lists(st.lists(st.integers(-1, 30), max_size=2), max_size=2)
FAULTS = st.lists(
    st.fixed_dictionaries(
        {"at_s": NUMBERS, "kind": KINDS}, optional={"agents": WHO, "slots": WHO, "groups": GROUPS}
    ),
    max_size=3,
)
JUNK = st.one_of(
    NUMBERS, st.none(), st.booleans(), st.text(), st.sampled_from(["off", "contact", "custom", "line", "heard", "yes"]), FAULTS,
    st.lists(NUMBERS, max_size=3), st.lists(st.lists(NUMBERS, max_size=3), max_size=3),
    st.dictionaries(st.text() | st.integers(), st.integers(), max_size=2),
)  # fmt: skip


@given(st.lists(st.tuples(st.sampled_from(PLACES), JUNK), min_size=1, max_size=4))
def test_whatever_is_written_gives_a_mission_that_reads_back_or_one_line_that_names_a_field(
    written: list[tuple[tuple[str, ...], object]],
) -> None:
    fields: dict[str, Any] = {}
    for (*sections, last), junk in written:
        place = fields
        for section in sections:
            if not isinstance(place.get(section), dict):
                place[section] = {}
            place = place[section]
        place[last] = junk
    try:
        mission = parse_mission(fields, "my.yaml")
    except MissionError:
        text = refusal(fields)
        assert len(text) < 3000
        assert any(name in text for place in PLACES for name in place)
        return
    assert parse_mission(read_yaml(mission_yaml(mission))) == mission
    assert min(times_of(mission)) > 0


@given(
    speed=st.floats(0.5, 9.9),
    goal=st.floats(-1000, 1000),
    range_m=st.floats(5, 100),
    loss=st.floats(0, 1),
    seed=st.integers(0, 2**32 - 1),
    name=st.text(min_size=1, max_size=200).filter(str.isprintable),
)
def test_numbers_of_many_digits_survive_the_journey_through_yaml(
    speed: float, goal: float, range_m: float, loss: float, seed: int, name: str
) -> None:
    mission = Mission(
        name=name,
        target={"speed_mps": speed},  # type: ignore[arg-type]
        radio={"range_m": range_m, "loss": loss},  # type: ignore[arg-type]
        goal_x_m=goal,
        seed=seed,
    )
    assert parse_mission(read_yaml(mission_yaml(mission))) == mission
