"""A controller of one's own against the one that comes with the project, on maps that are there for tuning."""

from pathlib import Path

import rsc_swarm as rs

HERE = Path(__file__).parent


def main(maps: int = 20) -> None:
    for policy in (f"{HERE / 'homing.py'}:Homing", "analytic"):
        row = rs.evaluate(
            rs.mission("dense", agents=9, policy=policy), maps=maps, starts=1, seed_base=1_000_000
        )
        low, high = row.success_interval
        print(
            f"{row.success_rate:.0%} of {row.runs} flights succeed ({low:.0%} to {high:.0%}): {Path(policy).name}"
        )


if __name__ == "__main__":
    main()
