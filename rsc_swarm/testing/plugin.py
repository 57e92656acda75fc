"""The pytest plugin: the fixture ``swarm``, and failures that can be read.

It is loaded by every pytest where the package is installed, so it imports nothing before a test asks for it.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from rsc_swarm.testing.swarm import Swarm


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--swarm-failures",
        metavar="DIR",
        default="swarm-failures",
        help="where missions go that broke something (swarm-failures)",
    )


@pytest.fixture(scope="session")
def swarm(request: pytest.FixtureRequest) -> "Swarm":
    """Flies missions (rsc_swarm.testing.Swarm). Of the whole session, as Hypothesis asks of the fixtures it is used with."""
    from rsc_swarm.testing.swarm import Swarm

    return Swarm(Path(request.config.getoption("--swarm-failures")))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: "pytest.CallInfo[None]") -> Iterator[None]:
    """Tell a flight that broke something by its own text, without the lines of code in between."""
    outcome: Any = yield
    error = call.excinfo.value if call.excinfo else None
    if type(error).__module__ == "rsc_swarm.testing.swarm" and type(error).__name__ == "Broke":
        outcome.get_result().longrepr = f"{item.nodeid}\n{error}"
