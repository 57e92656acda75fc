"""A flight has one digest, whatever NumPy and the C library find in the processor; rules are compiled for every processor alike.

More: python -m tests.scenarios.processors
"""

import pytest

from tests.scenarios.processors import digests, plain_library, plain_numpy


@pytest.mark.parametrize("policy", ["analytic", "saber", "rsc-h20"])
def test_what_libraries_find_in_the_processor_changes_no_flight(policy: str) -> None:
    usual = digests({}, policy, 2, fly_s=2.0)
    assert len(set(usual)) == 2
    assert digests({**plain_numpy(), **plain_library()}, policy, 2, fly_s=2.0) == usual
