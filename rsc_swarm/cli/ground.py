"""``rsc-swarm ground``: the operator of a fleet on the air."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from protocols.errors import ExitCode
from rsc_swarm.cli.app import ViewOptions, announce_compiling, app, examples, refuse_besides, with_options
from rsc_swarm.cli.fly_alone import FleetFile

if TYPE_CHECKING:
    from protocols.fleet.plan import Plan
    from rsc_swarm.air.judged import Judged


@app.command(
    epilog=examples(
        "ground --fleet six.yaml",
        "ground --fleet six.yaml --do preflight,arm,takeoff,go",
        "ground --fleet six.yaml --check",
    )
)
@with_options
def ground(
    context: typer.Context,
    fleet: FleetFile,
    page: ViewOptions,
    do: Annotated[
        str | None,
        typer.Option(
            metavar="STEPS",
            help="Do this and leave when all are down: preflight, arm, takeoff, go, hold, land, abort, kill, wait=SECONDS, "
            "with commas between.",
        ),
    ] = None,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep each flight as the operator saw it: DIR/1, DIR/2, ..."),
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="Only say whether the fleet can be flown, and draw its plan.")
    ] = False,
    out: Annotated[
        Path, typer.Option(metavar="FILE", help="With --check: picture to write, .png, .svg or .pdf.")
    ] = Path("plan.png"),
) -> None:
    """Watch a fleet on the air and give orders; nothing flies before preflight is green."""
    from rsc_swarm.air.plans import keys_of, read_plan

    if check:
        refuse_besides(context, "--check", "fleet", "out")
    plan = read_plan(fleet)
    if check:
        from rsc_swarm.air.radios import radios_of
        from rsc_swarm.show.plots.room import draw_plan

        draw_plan(plan, out)
        keys_of(fleet, plan)
        for doubt in (doubt for radio in radios_of(plan) for doubt in radio.doubts):
            typer.echo(f"{fleet}: {doubt}", err=True)
        typer.echo(f"{fleet}: can be flown by {plan.drones_told} in {plan.ticks / 100:g} s; drawn in {out}")
        return
    from rsc_swarm.air.station import Script, read_script

    steps, keys = read_script(do, plan) if do is not None else None, keys_of(fleet, plan)
    announce_compiling()
    from rsc_swarm.air.tower import watch
    from rsc_swarm.show.fleet_view import FleetView
    from rsc_swarm.watch.site import Asked, served

    asked_for = Asked(page.view_host, page.view_port, page.open)
    serving = served(asked_for, hands=False) if page.view or page.open else nullcontext()
    with (
        serving as site,
        FleetView(f"{fleet}: {plan.drones_told}, mission {plan.mission.name}", keys=steps is None) as table,
    ):
        script = Script(steps, table.say) if steps else None
        attend = table.attend
        if site:
            from rsc_swarm.watch.aloft import Aloft

            attend = Aloft(site.window, attend)
            table.say(f"watch it at {site.address}")
        _, outcome, asked = watch(plan, keys, attend, script, run_dir)
    if outcome:
        typer.echo(_told(plan, outcome))
    if asked:
        raise typer.Exit(ExitCode.INTERRUPTED)
    if (script and script.failed) or (outcome and outcome.failure):
        raise typer.Exit(ExitCode.FAILED)


def _told(plan: "Plan", outcome: "Judged") -> str:
    head = (
        f"SUCCESS: in formation behind the goal line after {outcome.tau_s:.2f} s"
        if outcome.tau_s is not None and not outcome.failure
        else f"FAILED: {outcome.failure}"
    )
    slot = (
        "" if outcome.slot_error_m is None else f"; worst slot error at the end {outcome.slot_error_m:.2f} m"
    )
    return f"{head}; closest {outcome.closest_m:.2f} m (a collision is less than {plan.limit_m:.2f} m){slot}."
