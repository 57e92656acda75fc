"""The yardstick for a swarm's speed: the bare lockstep echo, with real processes, logins and access control.

Each tick the world sends every agent a message and waits for all answers. Nothing is computed and nothing is
unpacked, so no flight with messages of these sizes can be faster on this machine.
"""

import time
from pathlib import Path

from agent.radio.link import AgentLink
from protocols.whole_file import write_whole
from protocols.wire.login import Login
from rsc_swarm.flight.processes import Supervisor, leave_on_sigterm
from rsc_swarm.flight.socket_folder import RunFolder
from world.server.credentials import Credentials
from world.server.link import WorldLink

_SWARM = "echo"
_WARM_UP_TICKS = 50
_PATIENCE_S = 10.0
_LOOK_UP_S = 0.2


def bare_echo(
    agents: int,
    up_bytes: int = 300,
    down_bytes: int = 1200,
    ticks: int = 500,
    endpoint: str | None = None,
) -> float:
    """Ticks per second of the bare echo.

    Args:
        agents: how many agent processes.
        up_bytes: size of what an agent answers.
        down_bytes: size of what the world sends to each agent.
        ticks: how many ticks are timed, after a short warm-up.
        endpoint: where the world listens; None: a socket in a private folder.

    Raises:
        RuntimeError: a process ended early, or an answer did not come in 10 s.
    """
    credentials = Credentials.fresh(_SWARM, agents)
    with RunFolder() as folder, Supervisor() as processes:
        where = endpoint or folder.endpoint
        result, log = folder.path / "ticks-per-second", folder.path / "echo.log"
        processes.start("world", _world, credentials, where, down_bytes, ticks, result, log=log)
        for agent in range(agents):
            answer = bytes(up_bytes)
            processes.start(f"agent-{agent}", _agent, where, credentials.login(agent), answer, log=log)
        ended = processes.wait(timeout_s=3600.0)
        if not result.exists():
            reason = log.read_text().partition("\n")[0] or ", ".join(map(str, ended))
            raise RuntimeError(f"the echo broke off: {reason}")
        return float(result.read_text())


def _world(credentials: Credentials, endpoint: str, down_bytes: int, ticks: int, result: Path) -> None:
    agents = range(len(credentials.passwords))
    message = bytes(down_bytes)
    with WorldLink(credentials, [endpoint]) as link:
        _await_all(link, len(agents), "connect")
        for count in (_WARM_UP_TICKS, ticks):
            started = time.perf_counter()
            for _ in range(count):
                for agent in agents:
                    link.send(agent, message)
                _await_all(link, len(agents), "answer")
            took = time.perf_counter() - started
    write_whole(result, repr(ticks / took))


def _await_all(link: WorldLink, agents: int, doing_what: str) -> None:
    for missing in range(agents, 0, -1):
        if link.receive(_PATIENCE_S) is None:
            raise RuntimeError(f"{missing} of {agents} agents did not {doing_what} within {_PATIENCE_S:g} s")


def _agent(endpoint: str, login: Login, answer: bytes) -> None:
    with AgentLink(endpoint, login) as link:
        leave = leave_on_sigterm()
        link.send(answer)
        while not leave.asked:
            if link.receive(_LOOK_UP_S) is not None:
                link.send(answer)
