"""``rsc-swarm mission``: what would be flown, field by field."""

import sys

import yaml

from protocols.mission.document import MissionError
from protocols.mission.formation import default_shape
from rsc_swarm.cli.options import SHIPPED, MissionOptions, resolve, shipped_missions
from rsc_swarm.flight.run_dir import mission_yaml


def run(options: MissionOptions, check: bool, list_: bool) -> None:
    """Print the mission, or only check it, or list the shipped ones.

    Raises:
        MissionError, agent.policy.PolicyError, world.field.FieldError: it cannot be flown.
    """
    if list_:
        for name in shipped_missions():
            print(f"{name:<16} {about(name)}")
        return
    mission = resolve(options)
    from agent.policy import find_policy
    from world.field import draw_obstacles, draw_start

    find_policy(mission.policy, mission)
    draw_start(mission, draw_obstacles(mission))
    asked = mission.formation.shape
    shape = default_shape(mission.agents) if asked == "auto" else asked
    if check:
        print(f"{options.mission or 'mission'}: can be flown by {mission.agents} agents, formation {shape}")
    else:
        sys.stdout.write(mission_yaml(mission))


def about(name: str) -> str:
    """What a shipped mission is, from its first comment line."""
    path = SHIPPED / f"{name}.yaml"
    first = path.read_text(encoding="utf-8").splitlines()[0]
    if not first.startswith("# ") or not isinstance(yaml.safe_load(path.read_text(encoding="utf-8")), dict):
        raise MissionError(f"{path}: must begin with a comment that says what it is")
    return first.removeprefix("# ")
