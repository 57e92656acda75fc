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
    """Tell a flight that broke something by its own text, without the lines of code in between, and with its story: where that
    page lies, and for pytest-html the page itself."""
    outcome: Any = yield
    error: Any = call.excinfo.value if call.excinfo else None
    if type(error).__module__ != "rsc_swarm.testing.swarm" or type(error).__name__ != "Broke":
        return
    from protocols.errors import SwarmError

    result = outcome.get_result()
    try:
        page = error.report()
    except SwarmError as why:  # the failure is told all the same
        result.longrepr = f"{item.nodeid}\n{error}\nIts story could not be written: {why}"
        return
    result.longrepr = f"{item.nodeid}\n{error}\nWhat, when, why: {page}"
    if pytest_html := item.config.pluginmanager.getplugin("html"):
        told = pytest_html.extras.html(page.read_text(encoding="utf-8"))
        result.extras = [*getattr(result, "extras", []), told]
