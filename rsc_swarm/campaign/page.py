"""The report of a campaign: one page, one line a failure, with the command that replays it."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from string import Template

from protocols.whole_file import write_whole
from rsc_swarm.campaign.campaign import groups
from rsc_swarm.campaign.flying import Failure, Plan, Tally
from rsc_swarm.campaign.kept import replay_command
from rsc_swarm.flight.provenance import commit
from rsc_swarm.study.intervals import failure_bound

_PAGE = Template("""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>$title</title>
<style>
  :root { color-scheme: light dark; font: 16px/1.5 system-ui, sans-serif; }
  body { max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
  table { border-collapse: collapse; width: 100%; }
  th, td { text-align: left; vertical-align: top; padding: .3rem .8rem .3rem 0; border-top: 1px solid #8884; }
  code { font-size: .85rem; overflow-wrap: anywhere; }
  .unsafe { color: #c22; font-weight: 600; }
  .number { text-align: right; }
</style>
<h1>$title</h1>
<p>$summary</p>
<p>Budget of one flight: $budget<br>Commit: <code>$commit</code><br>Once more: <code>$again</code></p>
$failures
</html>
""")


def write_index(folder: Path, plan: Plan, tally: Tally, places: Mapping[str, Path], again: str) -> Path:
    """Write ``folder/index.html``; where it is.

    Args:
        places: where the mission of each failure was kept, by its digest; beside it, with the ending .html, the story of the
            flight, where there is one. again: the command that flies the campaign.

    Raises:
        protocols.whole_file.WriteError: it cannot be written.
    """
    found = groups(tally)
    unsafe = sum(failure.broken.safety for failure in tally.failures)
    summary = (
        f"{tally.flights:,} flights of {plan.mission.agents} drones, {unsafe or 'none'} unsafe, "
        f"{len(tally.failures) - unsafe or 'none'} not alive, {tally.excused} excused. "
    )
    if not tally.failures:
        summary += (
            f"Less than {100 * failure_bound(tally.flights):.2g} % of such flights break something (95 %)."
        )
    tables = [
        f"<h2{' class=unsafe' if group.failures[0].broken.safety else ''}>{escape(group.name)}: {len(group.failures)}</h2>"
        "<table><tr><th>map, seed<th>faults<th>what happened<th>report<th>mission<th>replay</tr>"
        + "".join(_row(failure, places[failure.digest], folder) for failure in group.failures)
        + "</table>"
        for group in found
    ]
    text = _PAGE.substitute(
        title=escape(f"Campaign {plan.mission.name}, seed {plan.seed}"),
        summary=escape(summary),
        budget=escape(str(plan.budget)),
        commit=escape(commit() or "no checkout"),
        again=escape(again),
        failures="\n".join(tables),
    )
    index = folder / "index.html"
    write_whole(index, text)
    return index


def _row(failure: Failure, place: Path, folder: Path) -> str:
    mission = failure.mission
    count = (
        f"{len(mission.faults)} of {failure.faults}" if failure.shrunk else f"{failure.faults}, not shrunk"
    )
    link, story = place.relative_to(folder).as_posix(), place.with_suffix(".html")
    told = (
        f'<a href="{escape(story.relative_to(folder).as_posix())}">what, when, why</a>'
        if story.exists()
        else ""
    )
    return (
        f"<tr><td>{mission.map_seed}, {mission.seed}<td>{count}<td>{escape(failure.broken.detail)}<td>{told}"
        f'<td><a href="{escape(link)}">{escape(place.name)}</a>'
        f"<td><code>{escape(replay_command(place))}</code></tr>"
    )
