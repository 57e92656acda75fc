"""How much quicker two Dask workers fly than one: ``python -m tests.scenarios.crews [--flights 256]``, on a quiet machine.

Both have flown before, so that neither the start of workers nor loading the rules counts; what is flown is the same.
"""

import argparse
import time

from protocols.mission.document import Mission
from rsc_swarm.study.evaluate import evaluate, seeds_of
from rsc_swarm.study.machines import Who, crew_of

_MAPS = 3_000_000


def flown_in(workers: int, flights: int) -> float:
    """Seconds in which so many flights are flown."""
    mission = Mission(agents=9)
    with crew_of(Who(on=f"local:{workers}")) as crew:
        evaluate(mission, seeds_of(_MAPS, 2 * workers, 1), crew)
        began = time.monotonic()
        evaluate(mission, seeds_of(_MAPS, flights, 1), crew)
        return time.monotonic() - began


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=256)
    flights = parser.parse_args().flights
    one, two = flown_in(1, flights), flown_in(2, flights)
    print(
        f"{flights} flights of 9 drones: {one:.1f} s on one Dask worker, {two:.1f} s on two: {one / two:.2f} times as fast"
    )


if __name__ == "__main__":
    main()
