"""A campaign finds what breaks, makes it short, keeps it, and goes on where it was stopped."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from protocols.mission.document import Mission
from protocols.mission.reading import write_yaml
from protocols.wire.status import SWAP_COUNTS
from rsc_swarm.campaign import flying
from rsc_swarm.campaign.budget import parse_budget
from rsc_swarm.campaign.campaign import FlownTasks, fly, groups
from rsc_swarm.campaign.flying import Plan, Tally
from rsc_swarm.campaign.judging import Broken, Excused, judge
from rsc_swarm.campaign.kept import Flown, Kept, KeptError, all_kept, fly_kept, keep
from rsc_swarm.campaign.page import write_index
from rsc_swarm.cli import main as cli
from rsc_swarm.study.finished import FinishedFlightsError
from rsc_swarm.study.machines import Crew
from rsc_swarm.study.workers import Flight
from world.invariants import Watched
from world.outcome import Outcome

# Where nobody may trade slots, a dead leader's slot stays empty, and the formation is never complete.
STIFF = Mission(
    name="stiff", agents=4, policy="analytic", swap={"rule": "off"}, obstacles={"count": [0, 0]}, goal_x_m=3, time_limit_s=4,
    start={"radius_m": 1},
)  # fmt: skip
PLAN = Plan(STIFF, parse_budget("none,kill=1,slow=1,restart=1,until_s=0.5,slow_s=0.5"), seed=1, flights=12)


def unheard(tally: Tally, shrinking: int) -> None:
    pass


def test_what_breaks_is_made_short_and_kept_and_can_be_checked(tmp_path: Path) -> None:
    tally = fly(PLAN, Crew(1), tmp_path, unheard)
    assert tally.flights == 12
    (group,) = groups(tally)
    assert group.name == "not in formation in time"
    shortest = group.failures[0]
    assert shortest.shrunk
    assert [fault.kind for fault in shortest.mission.faults] == ["kill"]
    places = {failure.digest: keep(failure, tmp_path) for failure in tally.failures}
    assert len(set(places.values())) == len(places), "one file for each flight"

    for kept in all_kept(tmp_path):
        flown = fly_kept(kept)
        assert flown.broken
        assert flown.digest == kept.digest
        assert str(flown).startswith(f"{kept.path}: not in formation in time, as kept bit for bit: ")
    kept = all_kept(tmp_path)[0]
    mended = replace(kept, mission=kept.mission.model_copy(update={"faults": ()}))
    assert str(fly_kept(mended)) == f"{kept.path}: keeps all (it broke: not in formation in time)"

    page = write_index(tmp_path, PLAN, tally, places, "rsc-swarm campaign <&>").read_text()
    assert page.count("--replay") == len(tally.failures)
    assert "rsc-swarm campaign &lt;&amp;&gt;" in page
    twin = replace(shortest, digest="f" * 32)
    assert keep(twin, tmp_path / "elsewhere") != keep(shortest, tmp_path / "elsewhere"), "of the same seeds"


def test_the_index_leads_to_the_story_of_what_was_made_short(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "stiff.yaml").write_text(write_yaml(STIFF.model_dump(mode="json", exclude_defaults=True)))
    words = ["--budget", str(PLAN.budget), "--seed", "1", "--flights", "12", "--workers", "1"]
    monkeypatch.setattr(
        sys, "argv", ["rsc-swarm", "campaign", f"{tmp_path}/stiff.yaml", *words, "--out", f"{tmp_path}/out"]
    )
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 1
    assert "not in formation in time: " in capsys.readouterr().out
    stories = re.findall(r'<a href="([^"]+\.html)">', (tmp_path / "out" / "index.html").read_text())
    assert stories
    for story in stories:
        assert "lost agent" in (tmp_path / "out" / story).read_text()


def test_a_stopped_campaign_goes_on_and_a_longer_one_flies_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flying, "TASK", 4)
    monkeypatch.setattr("rsc_swarm.campaign.campaign.SHRUNK", 0)

    def stop(tally: Tally, shrinking: int) -> None:
        if tally.flights:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly(PLAN, Crew(1), tmp_path, stop)
    seen: list[int] = []
    tally = fly(PLAN, Crew(1), tmp_path, lambda tally, shrinking: seen.append(tally.flights))
    assert seen[0] == 4
    assert tally == fly(PLAN, Crew(2), tmp_path / "whole", unheard)
    seen.clear()
    fly(replace(PLAN, flights=16), Crew(1), tmp_path, lambda tally, shrinking: seen.append(tally.flights))
    assert (seen[0], seen[-1]) == (12, 16)


SOUND = Outcome(True, None, 1300, 13.0, 2.0, 0.01, 0.1, 1.0, "", None, 0.0, (), "d")
SEEN = Watched(None, 0.0, 0.5, None, True, 3, 0)
SWAPS = dict.fromkeys(SWAP_COUNTS, 0)
HUNG = Mission(
    agents=9,
    faults=[{"at_s": 2, "kind": "freeze", "agents": [4]}, {"at_s": 2.5, "kind": "thaw", "agents": [4]}],
)


def collision(who: str, at_s: float) -> Outcome:
    return replace(
        SOUND, success=False, failure="collision", closest=f"{who} at x = 1.0 m, y = 2.0 m, t = {at_s:.2f} s"
    )


@pytest.mark.parametrize(
    ("outcome", "watched", "name"),
    [
        (SOUND, SEEN, None),
        (SOUND, replace(SEEN, breach="permutation broken at tick 7: agent 3 believes []"), "slots: permutation broken"),
        (SOUND, replace(SEEN, breach="livelock at tick 7: 99 swaps"), "slots: livelock"),
        (collision("agents 1 and 2", 2.2), SEEN, "drones hit each other"),
        (collision("agent 1 and obstacle 4", 2.2), SEEN, "drones hit an obstacle"),
        (collision("agent 4 and obstacle 1", 1.9), SEEN, "drones hit an obstacle"),
        (collision("agent 4 and obstacle 1", 2.2), SEEN, "excused"),
        (collision("agents 1 and 4", 3.4), SEEN, "excused"),
        (collision("agent 4 and obstacle 1", 3.6), SEEN, "drones hit an obstacle"),
        (SOUND, replace(SEEN, undone=1), "a swap is undone"),
        (replace(SOUND, success=False, failure="late"), SEEN, "not in formation in time"),
        (SOUND, replace(SEEN, agreed=False, agreed_after_s=None), "views differ to the end"),
        (SOUND, replace(SEEN, agreed=False, agreed_after_s=0.5), None),
        (replace(SOUND, ticks=300), replace(SEEN, agreed=False, agreed_after_s=None), None),
    ],
)  # fmt: skip
def test_a_flight_is_judged(outcome: Outcome, watched: Watched, name: str | None) -> None:
    found = judge(HUNG, Flight(1, 1, outcome, watched, SWAPS))
    assert ("excused" if isinstance(found, Excused) else found and found.name) == name
    if isinstance(found, Broken):
        assert found.safety == (name not in ("not in formation in time", "views differ to the end"))


@pytest.mark.parametrize("before", [[("kill", 1)], [("freeze", 0.5), ("kill", 1), ("thaw", 1.5)]])
def test_who_comes_back_from_the_dead_may_come_back_amid_the_others(before: list[tuple[str, float]]) -> None:
    faults = [{"at_s": at_s, "kind": kind, "agents": [4]} for kind, at_s in [*before, ("restart", 2)]]
    mission = Mission(agents=9, faults=faults)
    for at_s, excused in ((2.2, True), (3.4, False)):
        found = judge(mission, Flight(1, 1, collision("agents 1 and 4", at_s), SEEN, SWAPS))
        assert isinstance(found, Excused) == excused


def test_a_lie_is_an_excuse_only_among_drones_that_see_nobody() -> None:
    lie = [
        {"at_s": 1, "kind": "lie", "agents": [3], "lie": "position"},
        {"at_s": 2, "kind": "truth", "agents": [3]},
    ]
    for neighbours, at_s, excused in (("heard", 2.2, True), ("heard", 3.4, False), ("sensed", 1.5, False)):
        mission = Mission(agents=9, sensing={"neighbours": neighbours}, faults=lie)
        found = judge(mission, Flight(1, 1, collision("agents 1 and 4", at_s), SEEN, SWAPS))
        assert isinstance(found, Excused) == excused


@pytest.mark.parametrize(
    ("neighbours", "who", "at_s", "excused"),
    [
        ("heard", "agents 1 and 4", 1.4, False),  # what it said before is believed for half a second
        ("heard", "agents 1 and 4", 1.6, True),
        ("heard", "agents 1 and 4", 3.9, True),
        ("heard", "agents 1 and 4", 4.1, False),
        ("heard", "agents 1 and 2", 1.6, False),  # on one side
        ("heard", "agents 1 and 2", 2.6, True),  # parted anew
        ("heard", "agent 1 and obstacle 4", 1.6, False),
        ("sensed", "agents 1 and 4", 1.6, False),
    ],
)
def test_a_parted_radio_is_an_excuse_only_for_drones_that_neither_see_nor_hear_each_other(
    neighbours: str, who: str, at_s: float, excused: bool
) -> None:
    parted = [
        {"at_s": 1, "kind": "part", "groups": [[0, 1, 2], [3, 4, 5, 6, 7, 8]]},
        {"at_s": 2, "kind": "part", "groups": [[0, 1, 3], [2, 4, 5, 6, 7, 8]]},
        {"at_s": 3, "kind": "heal"},
    ]
    mission = Mission(agents=9, sensing={"neighbours": neighbours}, faults=parted)
    found = judge(mission, Flight(1, 1, collision(who, at_s), SEEN, SWAPS))
    assert isinstance(found, Excused) == excused


def test_a_swap_may_be_undone_for_the_reasons_that_are_stated() -> None:
    undone = replace(SEEN, undone=1)
    assert judge(HUNG, Flight(1, 1, SOUND, undone, {**SWAPS, "timed_out": 1})) is None
    assert judge(HUNG, Flight(1, 1, SOUND, undone, {**SWAPS, "vacated": 1})) is None
    restarted = HUNG.model_copy(
        update={"faults": Mission(faults=[{"at_s": 1, "kind": "restart", "agents": [0]}]).faults}
    )
    assert judge(restarted, Flight(1, 1, SOUND, undone, SWAPS)) is None


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("campaign nowhere", "--mission nowhere: no such file"),
        ("campaign plain --mission dense", "--mission dense: plain is given already"),
        ("campaign --map 3", "--map: a campaign draws the maps; leave it out"),
        ("campaign --check /nowhere", "--check /nowhere: no missions here"),
        ("campaign --replay /nowhere.yaml", "/nowhere.yaml: cannot be read"),
        ("campaign --agents 4 --budget kill=4", "--budget kill=4: leaves none of 4 drones"),
    ],
)
def test_bad_usage_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str, line: str
) -> None:
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", *words.split()])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"rsc-swarm: {line}")


def test_the_folder_of_a_campaign_in_which_nothing_broke_can_be_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with FlownTasks(tmp_path, PLAN):
        pass
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", "campaign", "--check", str(tmp_path)])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert not left.value.code
    assert capsys.readouterr().out == "0 missions, none broke something\n"


def test_what_a_kept_mission_says_of_itself_is_shown_and_not_obeyed(tmp_path: Path) -> None:
    place = tmp_path / "a\x1b[2J.yaml"
    place.write_text("# broke: \u202eall\nagents: 1\nfly_s: 0.1\n")
    (kept,) = all_kept(tmp_path)
    assert kept.broke == r"\u202eall"
    assert str(Flown(kept, None, "")) == rf"{tmp_path}/a\x1b[2J.yaml: keeps all (it broke: \u202eall)"


def test_without_hypothesis_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "hypothesis", None)
    monkeypatch.setattr(sys, "argv", ["rsc-swarm", "campaign"])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 2
    assert "a campaign needs hypothesis: pip install -e '.[campaign]'" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(KeptError, match="cannot be used"):
        fly(PLAN, Crew(1), tmp_path / "file" / "folder", unheard)


def test_two_campaigns_do_not_write_one_journal(tmp_path: Path) -> None:
    with (
        FlownTasks(tmp_path, PLAN),
        pytest.raises(FinishedFlightsError, match="another command is writing here"),
    ):
        fly(PLAN, Crew(1), tmp_path, unheard)


@pytest.mark.parametrize("kept", all_kept(Path(__file__).parent / "kept"), ids=lambda kept: kept.path.stem)
def test_what_broke_once_breaks_no_more(kept: Kept) -> None:
    assert fly_kept(kept).broken is None
