"""A flight has one digest, whatever NumPy finds in the processor; rules are compiled for every processor alike.

More: python -m tests.scenarios.processors
"""

import pytest

from tests.scenarios.processors import digests, plain_numpy


@pytest.mark.parametrize("policy", ["analytic", "rsc-h20"])
def test_numpys_choice_of_loops_changes_no_flight(policy: str) -> None:
    usual = digests({}, policy, 2, fly_s=2.0)
    assert len(set(usual)) == 2
    assert digests(plain_numpy(), policy, 2, fly_s=2.0) == usual
