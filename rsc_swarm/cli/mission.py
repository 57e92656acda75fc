"""``rsc-swarm mission``: what would be flown, field by field."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from rsc_swarm.cli.app import app, examples, refuse_besides, with_options
from rsc_swarm.missions import SHIPPED, shipped_missions
from rsc_swarm.options import MissionOptions, resolve


@app.command(
    epilog=examples(
        "mission --list", "mission --mission dense --agents 36 > my.yaml", "mission --mission my.yaml --check"
    )
)
@with_options
def mission(
    context: typer.Context,
    options: MissionOptions,
    check: Annotated[bool, typer.Option("--check", help="Only say whether it can be flown.")] = False,
    shipped: Annotated[
        bool, typer.Option("--list", help="List the missions that come with rsc-swarm.")
    ] = False,
) -> None:
    """Print the mission these options make, every field, as YAML; refuse one that cannot be flown."""
    if shipped:
        refuse_besides(context, "--list")
        for name in shipped_missions():
            print(f"{name:<16} {about(name)}")
        return
    from protocols.dynamics import TICK_S
    from protocols.mission.document import mission_yaml
    from protocols.mission.formation import default_shape
    from protocols.mission.policy_name import from_folder
    from protocols.wire.keys import MAX_AGENTS
    from rsc_swarm.flight.policy_facts import policy_facts
    from world.field import draw_obstacles, draw_start

    made = resolve(options)
    policy_facts(made)  # raises what is wrong with its policy
    draw_start(made, draw_obstacles(made))
    asked = made.formation.shape
    shape = default_shape(made.agents) if asked == "auto" else asked
    if check:
        alone = " (simulate and evaluate only)" if made.agents > MAX_AGENTS else ""
        print(
            f"{options.mission or 'mission'}: can be flown by {made.agents} agents{alone}, formation {shape}, "
            f"within {made.ticks * TICK_S:g} s"
        )
    else:
        named = from_folder(made.policy, Path.cwd())  # the file may be written anywhere
        sys.stdout.write(mission_yaml(made.model_copy(update={"policy": named})))


def about(name: str) -> str:
    """What a shipped mission is, from its first comment line."""
    from protocols.mission.document import MissionError, read_mission_fields

    path = SHIPPED / f"{name}.yaml"
    first = path.read_text(encoding="utf-8").splitlines()[0]
    if not first.startswith("# ") or not read_mission_fields(path):
        raise MissionError(f"{path}: must begin with a comment that says what it is")
    return first.removeprefix("# ")
