"""A drone's end of the wire while there is no world: how it can be told to go."""

import time
from pathlib import Path

import pytest

from agent.radio.link import AgentLink
from protocols.wire.keys import LinkError
from protocols.wire.login import Login


def test_who_waits_for_a_world_can_be_told_to_leave(tmp_path: Path) -> None:
    began = time.monotonic()
    with pytest.raises(LinkError, match=r"^asked to leave before the world at .* answered$"):
        AgentLink(
            f"unixsock-stream/{tmp_path}/none.sock",
            Login("wedge", 0, "x"),
            leaving=lambda: time.monotonic() > began + 0.3,
        )
    assert time.monotonic() < began + 5.0
