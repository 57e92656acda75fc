"""A formation of one's own: the slots are read from a table, one a line, x forward and y left.

Every slot must be joined to the others by steps of exactly ``spacing_m``; a table that is not is refused in one line.
"""

from pathlib import Path

import numpy as np

import rsc_swarm as rs

HERE = Path(__file__).parent


def from_csv(table: Path, spacing_m: float = 5.0) -> rs.Mission:
    slots = np.loadtxt(table, delimiter=",", skiprows=1)
    shape = {"shape": "custom", "slots_m": slots.tolist(), "spacing_m": spacing_m}
    return rs.mission(name=table.stem, agents=len(slots), formation=shape, obstacles={"count": [0, 2]})


def main() -> None:
    flight = rs.simulate(from_csv(HERE / "arrow.csv"))
    print(flight.report.detail)


if __name__ == "__main__":
    main()
