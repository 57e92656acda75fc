"""How near the plans of a model are to the expert's: the MAE of the paper's tables (Sec. III-B).

This opens sessions of ONNX Runtime: no process that uses it may fork afterwards.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from agent.policy.model_file import read_model
from agent.policy.session import open_session
from protocols.mission.document import Mission
from rsc_swarm.batch.batch import Batch
from rsc_swarm.batch.model_inputs import model_inputs
from rsc_swarm.batch.stage import FLYING
from rsc_swarm.study.evaluate import STARTS_PER_MAP


def mae(model: Path, mission: Mission, maps: Sequence[int]) -> tuple[float, float]:
    """Mean absolute error [m] of a model's plans, and that of flying on at constant velocity.

    The model flies ``mission`` on every map (start 0) to the end of each flight. Whenever it plans, its positions over
    the horizon are compared with those of the expert it learned from, in the same state, before fusion and filter. The mean of
    |error| is taken over flights, plans, drones, steps and the two axes (the paper: MAE_sum / H).

    Raises:
        agent.policy.model_file.ModelFileError: the file holds no policy that can be flown.
    """
    read = read_model(model)
    session, facts = open_session(read.data), read.facts
    replan = mission.trajectory.replan_ticks or facts.replan
    wanted = [value.name for value in session.get_inputs()]
    missions = [
        mission.model_copy(update={"map_seed": place, "seed": STARTS_PER_MAP * place}) for place in maps
    ]
    batch = Batch(missions, papers=_learned_from_the_papers(facts.config))
    errors, moved, plans = 0.0, 0.0, 0
    while (flying := batch.stage.result == FLYING).any():
        inputs = model_inputs(
            batch.stage.observation, batch.stage.near, batch.stage.target, batch.stage.extra, facts.past
        )
        planned = session.run(None, {name: getattr(inputs, name) for name in wanted})
        displacement, acceleration = (
            value.reshape(batch.worlds, batch.agents, facts.horizon, 2) for value in planned
        )
        expected, _ = batch.label(facts.horizon)
        errors += float(np.abs(displacement - expected)[flying].mean((1, 2, 3)).sum())
        moved += float(np.abs(expected)[flying].mean((1, 2, 3)).sum())
        plans += int(flying.sum())
        batch.fly(replan, acceleration, displacement)
    return errors / plans, moved / plans


def _learned_from_the_papers(config: str) -> bool:
    """Whether the paper's expert taught a model of which its note tells this of its training."""
    try:
        return bool(json.loads(config)["expert"] == "paper")
    except (ValueError, KeyError, TypeError):  # of another version, or made elsewhere
        return False
