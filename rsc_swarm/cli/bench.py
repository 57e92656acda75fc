"""``rsc-swarm bench``: what this machine does."""

from pathlib import Path
from typing import Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import JsonFile, announce_compiling, app, examples, refuse_besides
from rsc_swarm.machine.leaving import unwind_when_asked


@app.command(
    epilog=examples("bench", "bench --agents 100 --quick", "bench --against ../the-version-before --pairs 9")
)
@unwind_when_asked()  # it starts other commands
def bench(
    context: typer.Context,
    agents: Annotated[int, typer.Option("--agents", "-n", help="Number of drones.")] = 25,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, rougher figures.")] = False,
    twins: Annotated[
        int | None,
        typer.Option(
            min=1, help="Instead: fly so many maps in real processes and in one, and compare digests."
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Instead: fly this code and that of the checkout in DIR in turn, and compare what a tick costs.",
        ),
    ] = None,
    pairs: Annotated[int, typer.Option(min=1, help="How many pairs of launches, with --against.")] = 7,
    json: JsonFile = None,
) -> None:
    """Measure this machine: ticks per second, start-up, memory."""
    if twins:
        refuse_besides(context, "--twins", "agents", "json")
    if against:
        refuse_besides(context, "--against", "agents", "pairs", "json")
    announce_compiling()
    from functools import partial
    from json import dumps

    from rsc_swarm.bench import bench as benches
    from rsc_swarm.cli.output import JsonOutput

    output = JsonOutput(json)
    if twins:
        flown = benches.twins(agents, twins, lambda line: typer.echo(line, err=True))
        counts = ", ".join(f"{number} {name.replace('_', ' ')}" for name, number in flown.items())
        output.tell(partial(typer.echo, counts, file=output.beside), dumps(flown, indent=2))
        raise typer.Exit(ExitCode.SUCCEEDED if flown["equal_digests"] == twins else ExitCode.FAILED)
    if against:
        from rsc_swarm.bench import against as beside

        costs = beside.against(
            against, agents, benches.POLICIES, pairs, lambda line: typer.echo(f"flying {line}...", err=True)
        )
        figures = {
            policy: {side: [cost._asdict() for cost in flown] for side, flown in sides.items()}
            for policy, sides in costs.items()
        }
        told = beside.render(costs, agents)
        output.tell(partial(typer.echo, told, file=output.beside), dumps(figures, indent=2))
        return
    figures = benches.bench(agents, quick, lambda line: typer.echo(f"measuring {line}...", err=True))
    output.tell(partial(typer.echo, benches.render(figures), file=output.beside), dumps(figures, indent=2))
