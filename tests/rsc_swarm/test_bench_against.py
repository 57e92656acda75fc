"""What two versions cost, told as ratios of pairs."""

from pathlib import Path

import pytest

from rsc_swarm.bench.against import AgainstError, Cost, _cost, _Look, against, render


def test_what_is_no_checkout_is_named(tmp_path: Path) -> None:
    with pytest.raises(AgainstError, match="is no checkout of rsc-swarm"):
        against(tmp_path, 4, ("analytic",), 1)


def test_costs_are_counted_over_the_last_four_fifths_of_a_flight() -> None:
    """Ten seconds of flight at twice real time; before it, one second of CPU for loading."""
    looks = [
        _Look(
            100.0 + s,
            {1: (1.0 + 0.2 * s, 1000 + 200 * s), 2: (1.0 + 0.1 * s, 400 * s), 3: (1.0 + 0.1 * s, 400 * s)},
        )
        for s in range(6)
    ]
    cost = _cost(looks, {"real_time_factor": 2.0, "time_s": 10.0, "pss_mb_per_agent": 9.0})
    assert cost == pytest.approx(Cost(2.0, 1000.0, 500.0, 5.0, 9.0))


def test_the_ratio_is_that_of_the_pairs() -> None:
    """A machine that slowed down to a tenth meanwhile says nothing."""
    here = [Cost(4.0, 1.0, 1.0, 1.0, 1.0), Cost(0.4, 1.0, 1.0, 1.0, 1.0), Cost(3.0, 1.0, 1.0, 1.0, 1.0)]
    there = [Cost(2.0, 2.0, 1.0, 1.0, 1.0), Cost(0.2, 2.0, 1.0, 1.0, 1.0), Cost(1.5, 2.0, 1.0, 1.0, 1.0)]
    lines = render({"analytic": {"here": here, "there": there}}, 25).splitlines()
    assert lines[1].split() == ["analytic", "x", "real", "time", "3", "1.5", "2.00"]
    assert lines[2].split()[-1] == "0.50"


def test_what_talking_alone_costs_stands_beside() -> None:
    (_, *lines) = render({"bare echo": {"here": [Cost(4.0, 900.0, 100.0, 90.0, 0.0)]}}, 25).splitlines()
    assert [line.split()[-1] for line in lines] == ["4", "900", "100", "90"], "nothing to compare it with"
