"""Journals of what was flown: plain text, of one writer, and whole whatever becomes of the disk."""

import json

import pytest

from rsc_swarm.study.evaluate import evaluate
from rsc_swarm.study.finished import FinishedFlights, FinishedFlightsError
from rsc_swarm.study.machines import Crew
from tests.disk import full_disk
from tests.rsc_swarm.test_evaluate import SEEDS, SHORT


def test_the_journal_is_plain_text(tmp_path):
    path = tmp_path / "j.jsonl"
    evaluate(SHORT, SEEDS[:2], Crew(1), path)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [(line["map_seed"], line["seed"]) for line in lines] == SEEDS[:2]
    assert lines[0]["outcome"]["failure"] == "late"


def test_two_evaluations_do_not_write_one_journal(tmp_path):
    with (
        FinishedFlights(tmp_path / "j.jsonl"),
        pytest.raises(FinishedFlightsError, match="another command is writing here"),
    ):
        FinishedFlights(tmp_path / "j.jsonl")


def test_a_journal_for_which_there_is_no_room_is_named(tmp_path):
    path = tmp_path / "j.jsonl"
    evaluate(SHORT, SEEDS[:1], Crew(1), path)
    named = pytest.raises(FinishedFlightsError, match=r"j\.jsonl: cannot be written \(File too large\)$")
    with named, full_disk(path.stat().st_size + 10):
        evaluate(SHORT, SEEDS[:2], Crew(1), path)
    evaluate(SHORT, SEEDS[:2], Crew(1), path)
    with FinishedFlights(path) as journal:
        assert list(journal.finished) == SEEDS[:2]
