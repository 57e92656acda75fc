"""How command-line options, mission files and defaults become one mission."""

import shlex
from pathlib import Path

import pytest
import typer
from hypothesis import example, given, settings
from hypothesis import strategies as st

from protocols.mission.document import Mission, MissionError, mission_yaml
from protocols.mission.policy_name import from_folder
from rsc_swarm.cli.app import with_options
from rsc_swarm.cli.mission import about
from rsc_swarm.missions import SHIPPED, shipped_missions
from rsc_swarm.options import Aim, Formation, MissionOptions, Swap, command_line, resolve
from world.field import draw_obstacles, draw_start


def test_without_options_the_standard_task_is_flown():
    assert resolve(MissionOptions()) == Mission()


def test_an_option_overrides_the_file_and_the_file_the_default(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("agents: 9\nradio: {loss: 0.1, delay_ms: 30}\n")
    mission = resolve(MissionOptions(mission=str(file), loss=0.4, swap=Swap.tree))
    assert (mission.agents, mission.radio.loss, mission.radio.delay_ms) == (9, 0.4, 30)
    assert mission.swap.rule == "tree"
    assert mission.radio.range_m == 6.0


def test_every_option_reaches_its_field():
    options = MissionOptions(
        agents=6, formation=Formation.vee, map=3, seed=4, policy="cruise", swap=Swap.off,
        frame_rate=10, loss=0.1, burst=0.2, delay_ms=5, jitter_ms=6, duplicate=0.3, reorder=0.4,
        set=["hold_s=2", "start.scrambled=true"],
    )  # fmt: skip
    mission = resolve(options)
    radio = mission.radio
    assert (mission.agents, mission.formation.shape, mission.map_seed, mission.seed) == (6, "vee", 3, 4)
    assert (mission.policy, mission.swap.rule, mission.hold_s, mission.start.scrambled) == (
        "cruise",
        "off",
        2,
        True,
    )
    assert (radio.frame_rate_hz, radio.loss, radio.burst.loss) == (10, 0.1, 0.2)
    assert (radio.delay_ms, radio.jitter_ms, radio.duplicate, radio.reorder) == (5, 6, 0.3, 0.4)


def test_the_command_that_flies_it_again_names_what_was_asked_for():
    options = MissionOptions(agents=9, loss=0.5, swap=Swap.off, set=["hold_s=2", "limits={speed_mps: 5}"])
    assert command_line("simulate", options, map=7) == (
        "rsc-swarm simulate --agents 9 --swap off --loss 0.5 --set hold_s=2 "
        "--set 'limits={speed_mps: 5}' --map 7"
    )


def parsed(words: list[str]) -> MissionOptions:
    """The options a command is given by these words."""
    got: list[MissionOptions] = []

    @with_options
    def command(options: MissionOptions) -> None:
        got.append(options)

    app = typer.Typer()
    app.command()(command)
    app(words, standalone_mode=False)
    return got[0]


def field_of(setting: str) -> str:
    return setting.partition("=")[0]


share, milliseconds = st.floats(0, 1), st.just(0.0) | st.floats(5, 500)
words = st.text(st.characters(codec="utf-8"), min_size=1).filter(str.isprintable)
asked = st.fixed_dictionaries(
    {},
    optional={
        "agents": st.integers(1, 250),
        "formation": st.sampled_from([Formation.auto, Formation.line]),
        "map": st.integers(0, 2**32 - 1),
        "seed": st.integers(0, 2**32 - 1),
        "policy": st.one_of(words, words.map("{}.py:Homing".format), words.map("{}/mine.onnx".format)),
        "aim": st.sampled_from(Aim),
        "swap": st.sampled_from(Swap),
        "frame_rate": st.sampled_from([100.0, 50.0, 100 / 3, 10.0]),
        "loss": share,
        "burst": st.floats(0, 0.96),
        "delay_ms": milliseconds,
        "jitter_ms": milliseconds,
        "duplicate": share,
        "reorder": share,
        "set": st.lists(
            st.one_of(
                st.builds("start.radius_m={:.9f}".format, st.floats(0, 5)),
                st.builds("obstacles.discs=[[20, 0, {:.17f}]]".format, st.floats(1, 2)),
                st.sampled_from(["policy=homing.py:Homing", "start.scrambled=true", "name='it''s \"so\"'"]),
            ),
            unique_by=field_of,
        ),
    },
)


@settings(max_examples=30)
@given(asked)
@example(
    {
        "loss": 0.1234567890123,
        "delay_ms": 123456.789e-3,
        "set": ["policy=homing.py:Homing"],
    }
)
@example({"policy": "cruise", "set": ["hold_s=1"]})
def test_the_command_that_flies_it_again_flies_the_same_mission_from_any_folder(asked):
    twice = {"policy"} & {*asked}
    others = [setting for setting in asked.get("set", []) if field_of(setting) not in twice]
    options = MissionOptions(**{**asked, "set": others})
    name, verb, *again = shlex.split(command_line("simulate", options))
    assert (name, verb) == ("rsc-swarm", "simulate")
    first, second = resolve(options), resolve(parsed(again))
    named = first.model_copy(update={"policy": from_folder(first.policy, Path.cwd())})
    assert named == second


def test_files_are_named_so_that_they_are_found_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "my missions").mkdir()
    (tmp_path / "my missions" / "a.yaml").write_text("policy: homing.py:Homing\nagents: 3\n")
    monkeypatch.chdir(tmp_path)
    options = MissionOptions(mission="my missions/a.yaml")
    assert resolve(options).policy == "my missions/homing.py:Homing", (
        "as the mission file says, from its folder"
    )
    again = shlex.split(command_line("simulate", options))
    assert again == ["rsc-swarm", "simulate", "--mission", f"{tmp_path}/my missions/a.yaml"]
    monkeypatch.chdir("/")
    assert resolve(parsed(again[2:])).policy == f"{tmp_path}/my missions/homing.py:Homing"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (MissionOptions(loss=2), "--loss: input should be less than or equal to 1, not 2"),
        (MissionOptions(agents=7, formation=Formation.square), "--agents: a square needs 4, 9, 16"),
        (MissionOptions(set=["radio.memori_s=1"]), "--set radio.memori_s: unknown field; known here: burst"),
        (MissionOptions(set=["hold_s"]), "--set hold_s: write FIELD=VALUE"),
        (MissionOptions(set=["hold_s=["]), "--set hold_s: the value is not valid YAML"),
        (MissionOptions(set=["hold_s=1", "hold_s=010"]), "--set hold_s: the value is not valid YAML"),
        (MissionOptions(set=["radio.loss=on"]), "--set radio.loss: write a number, not 'on'"),
        (
            MissionOptions(frame_rate=70),
            "--frame-rate: 70 Hz is no frame every so many ticks; the nearest are 50 and 100",
        ),
        (MissionOptions(set=["agents.x=1"]), "agents: write a whole number"),
        (MissionOptions(mission="nowhere"), "--mission nowhere: no such file; shipped missions are dense"),
    ],
)
def test_a_wrong_option_is_named_with_what_would_be_right(options, complaint):
    with pytest.raises(MissionError) as refused:
        resolve(options)
    assert str(refused.value).startswith(complaint)
    assert "\n" not in str(refused.value)


def test_a_mistake_in_the_file_names_the_file(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("radio: 3\n")
    with pytest.raises(MissionError, match=r"mine\.yaml: radio: write a mapping of its fields"):
        resolve(MissionOptions(mission=str(file), loss=0.1))


def test_a_file_goes_before_a_shipped_mission_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert resolve(MissionOptions(mission="dense")).obstacles.count == (12, 14)
    Path("dense").write_text("agents: 4\n")
    assert resolve(MissionOptions(mission="dense")).agents == 4


@pytest.mark.parametrize("name", shipped_missions())
def test_a_shipped_mission_can_be_flown_and_says_what_it_is(name):
    mission = resolve(MissionOptions(mission=name))
    assert mission.name == name
    assert about(name).endswith(".")
    assert len(draw_start(mission, draw_obstacles(mission))) == mission.agents


def test_a_printed_mission_is_the_same_mission(tmp_path):
    for name in shipped_missions():
        mission = resolve(MissionOptions(mission=str(SHIPPED / f"{name}.yaml"), map=5))
        file = tmp_path / "printed.yaml"
        file.write_text(mission_yaml(mission))
        assert resolve(MissionOptions(mission=str(file))) == mission


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        (
            {"set": ["radio.loss=0.1", "radio.loss=0.2"]},
            "--set radio.loss=0.2: --set radio.loss says something else of it; keep one",
        ),
        (
            {"set": ["radio.loss=0.2"], "loss": 0.1},
            "--set radio.loss=0.2: --loss says something else of it; keep one",
        ),
        (
            {"set": ["radio={hops: 2}"], "loss": 0.1},
            "--set radio={hops: 2}: --loss says something else of it; keep one",
        ),
        (
            {"set": ["radio={hops: 2}", "radio.loss=0.2"]},
            "--set radio.loss=0.2: --set radio says something else of it; keep one",
        ),
    ],
)
def test_what_is_said_twice_is_refused(given, complaint):
    with pytest.raises(MissionError) as refused:
        resolve(MissionOptions(**given))
    assert str(refused.value) == complaint
    resolve(MissionOptions(set=["radio.loss=0.2", "radio.hops=2"]))
