"""The training config: what it refuses, and in which words."""

import pytest

from rsc_swarm.training.config import TrainingError, make_config


def test_a_file_goes_on_top_of_a_preset_and_options_on_top_of_the_file(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("horizon: 10\nwidth: 64\n")
    config = make_config("paper", file, horizon=30, seed=None)
    assert (config.output, config.width, config.horizon, config.seed) == ("raw", 64, 30, 0)


def test_the_paper_has_its_own_shape():
    config = make_config("paper", None)
    shape = (config.width, config.feedforward, config.heads, config.past, config.output, config.extra)
    assert shape == (256, 256, 4, 3, "raw", "none")
    assert config.learning_rate == 3e-4


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("widht: 3", "widht: unknown field; known here: agents, aggregation, averaging, batch"),
        ("horizon: 0", "horizon: input should be greater than or equal to 1, not 0"),
        ("width: 30", "width: 30 is not a multiple of 4 heads"),
        ("replan_ticks: 21", "replan_ticks: 21 is beyond the horizon; give at most 20"),
        ("kind: stgnn", "output: stgnn acts for one tick; give action, not knots"),
        ("output: action", "horizon: output action is for one tick; give 1, not 20"),
        ("replay: 10", "replay: holds less than an epoch; give at least 9600"),
        ("{output: raw, position_weight: 0}", "position_weight: output raw learns positions only"),
        ("[1, 2]", "must be a mapping of fields"),
    ],
)
def test_a_bad_config_is_one_line_that_says_what_would_be_right(tmp_path, text, line):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(TrainingError) as refused:
        make_config("default", file)
    assert str(refused.value).startswith(f"{file}: ")
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_unknown_preset_is_refused_with_those_there_are():
    with pytest.raises(TrainingError, match="--preset none: no such preset; known: default, paper, stgnn"):
        make_config("none", None)
