"""Who is refused at the world's door is told there too, in plain words and once."""

import subprocess
import sys

import pytest

from rsc_swarm.flight.door import reason

# A world at which two drones knock that it does not let in, twice each.
KNOCKING = """
import socket, sys
from dataclasses import replace
from datetime import UTC, datetime
from agent.radio.link import AgentLink
from protocols.wire.keys import LinkError
from rsc_swarm.flight.door import door_watched
from world.server.credentials import make_keys
from world.server.link import WorldLink
ours, theirs = (make_keys("rsc", 2, ["127.0.0.1"], 1, datetime.now(UTC)) for _ in range(2))
guessing = replace(ours.logins[0], password="guessed")
with socket.create_server(("127.0.0.1", 0)) as free:
    endpoint = f"tls/127.0.0.1:{free.getsockname()[1]}"
with door_watched(lambda line: print(line, file=sys.stderr)):
    print("before")
    with WorldLink(ours.world, [endpoint]):
        for login in (guessing, theirs.logins[0]) * 2:
            try:
                AgentLink(endpoint, login, connect_timeout_s=0.5)
            except LinkError:
                print("refused")
print("after")
"""


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            "WARN tls: invalid peer certificate: UnknownIssuer. Hint: increase the limit",
            "keys were not made together",
        ),
        (
            "WARN tls: invalid peer certificate: BadSignature. Hint: increase the limit",
            "keys were not made together",
        ),
        (
            "WARN tls: invalid peer certificate: certificate expired: verification time 17 (UNIX)",
            "has expired",
        ),
        (
            'WARN quic: reason: "invalid peer certificate: certificate not valid yet: time 17',
            "compare the clocks",
        ),
        (
            "invalid peer certificate: certificate does not allow extended key usage for",
            "not that of a drone",
        ),
        ("WARN tls: peer sent no certificates", "shows no certificate"),
        ("WARN tls: received fatal alert: CertificateExpired", "compare the clocks"),
        ("WARN tls: received fatal alert: BadCertificate", "not for the address"),
        ("WARN tls: received fatal alert: UnknownCA", "keys were not made together"),
        ("WARN tls: received corrupt message of type InvalidContentType", "does not speak TLS"),
        ("DEBUG accept: UsrPwd extension - Recv OpenSyn. Invalid password. at x", "password is not"),
        ("WARN tls: Too many open files (os error 24). Hint: increase", "ulimit -n"),
        ("DEBUG accept: something else", None),
        ("", None),
    ],
)
def test_a_line_of_zenohs_log_in_plain_words(line: str, told: str | None) -> None:
    found = reason(line)
    assert (found is None) if told is None else (found is not None and told in found)


def test_the_world_tells_each_reason_once_and_writes_on_where_it_wrote() -> None:
    ended = subprocess.run([sys.executable, "-c", KNOCKING], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["before", "refused", "refused", "refused", "refused", "after"]
    told = sorted(ended.stderr.splitlines())
    assert len(told) == 2, told
    assert "its keys were not made together with this world's" in told[0]
    assert "its password is not that of its name" in told[1]
