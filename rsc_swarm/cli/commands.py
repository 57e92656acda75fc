"""All commands, in the order of the help. Importing them takes a moment, so `rsc_swarm.cli.main` does it late."""

from rsc_swarm.cli import (  # noqa: F401  each adds its command
    agent,
    agents,
    air,
    bench,
    campaign,
    evaluate,
    export,
    fly_alone,
    ground,
    keys,
    launch,
    mission,
    plot,
    radio,
    replay,
    report,
    schema,
    selfcheck,
    simulate,
    sweep,
    tables,
    train,
    warm_up,
    world,
)  # isort: skip
from rsc_swarm.cli.app import app as app
