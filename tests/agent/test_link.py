"""A drone's end of the wire while there is no world: how it can be told to go."""

import time
from pathlib import Path

import pytest
import zenoh

from agent.radio import link
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


class _BadNetwork:
    """A session to a world that does not hear, where farewells do not come through."""

    class _Publisher:
        class matching_status:
            matching = False

    def declare_subscriber(self, *_: object, **__: object) -> None: ...

    def declare_publisher(self, *_: object, **__: object) -> _Publisher:
        return self._Publisher()

    def close(self) -> None:
        raise zenoh.ZError("close operation timed out!")


def test_who_is_not_heard_over_a_bad_network_is_told_so_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "_open_unless", lambda *_: _BadNetwork())
    with pytest.raises(LinkError, match=r"does not hear agent 0 .*where the network loses much, try again$"):
        AgentLink("tcp/127.0.0.1:7447", Login("wedge", 0, "x"), 0.1)
