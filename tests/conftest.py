"""What all tests share: random examples may take their time on a busy machine, and Ctrl-C works.

A test run that was started in the background ignores Ctrl-C, one by nohup SIGHUP, and so would every process that it starts.
"""

import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("swarm", deadline=None)
settings.load_profile("swarm")

LONG = ("tests/scenarios/", "tests/test_examples.py", "tests/training/", "tests/rsc_swarm/")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files that take long come first: of several that run side by side none is then left alone at the end."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONG))


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    """The command answers signals for the rest of its process; in a test that is this one."""
    asking = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [(number, signal.getsignal(number)) for number in asking]
    yield
    for number, answer in before:
        signal.signal(number, answer)
