"""The table of a selfcheck."""

from collections.abc import Sequence

from rich.table import Table

from rsc_swarm.selfcheck.trials import Row


def render(rows: Sequence[Row]) -> Table:
    """What each attack cost the others."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in (
        "attack",
        "flights",
        "honest lost",
        "others succeeded",
        "time",
        "world MB",
        "the attacker",
    ):
        table.add_column(heading, overflow="fold")
    for row in rows:
        table.add_row(
            row.attack, str(row.flights), str(row.honest_lost), str(row.succeeded), f"{row.slowdown:.1f} x",
            f"{row.world_mb:.0f}", row.insider,
        )  # fmt: skip
    return table
