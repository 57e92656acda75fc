"""The world on one machine and each drone on its own (tests.scenarios.wires), over real sockets, and what may happen to them."""

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from protocols.errors import ExitCode, SwarmError
from protocols.mission.document import parse_mission
from protocols.wire.login import Login
from rsc_swarm.flight.alone import Watching, fly_agent, serve_world
from rsc_swarm.flight.report import report_of
from tests.scenarios.wires import Rules, Wires, address
from world.outlets.snapshot import Snapshot
from world.server.credentials import Credentials, make_keys

Fields = dict[str, Any]
Keys = tuple[Credentials, Callable[[int], Login]]
WORLD = 0  # its machine; drone i's is i + 1
GOOD = Rules()
_TRIES, _TRY_AGAIN = 10, ("no world answers", "does not hear", "does not let")


@dataclass
class Flight:
    """A flight under way: what its world says of itself, line by line, and who is whose process."""

    wires: Wires
    lines: Any
    world: int
    drones: list[int]
    start_drone: Callable[[int], int]
    tick: int = 0

    def await_tick(self, tick: int) -> None:
        """Return when the flight has come this far."""
        while self.tick < tick:
            said = json.loads(self.lines.readline() or '{"broken": "the world has ended"}')
            if "tick" not in said:
                raise AssertionError(said)
            self.tick = said["tick"]

    def for_a_while(self, seconds: float, rules: Rules, then: Rules = GOOD) -> None:
        """It is like this for so many seconds."""
        self.wires.rule(rules)
        time.sleep(seconds)
        self.wires.rule(then)

    def stop_world(self, seconds: float) -> None:
        """Ctrl-Z, and later fg."""
        os.kill(self.world, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(self.world, signal.SIGCONT)

    def restart_drone(self, agent: int) -> None:
        """Its machine ends its process and starts it again."""
        os.kill(self.drones[agent], signal.SIGKILL)
        self.wires.wait(self.drones[agent])
        self.drones[agent] = self.start_drone(agent)

    def report(self) -> Fields:
        """Wait for the end; what the world reports."""
        for line in self.lines:
            said: Fields = json.loads(line)
            if "tick" not in said:
                return said
        raise AssertionError("the world ended without a word")


def _serve(fields: Fields, clock: Any, credentials: Credentials, endpoint: str, out: int) -> int:
    mission, said = parse_mission(fields), os.fdopen(out, "w")

    def show(picture: Snapshot) -> None:
        print(json.dumps({"tick": picture.tick}), file=said, flush=True)

    try:
        flown, _ = serve_world(mission, clock, [endpoint], credentials, Watching(show))
    except SwarmError as error:
        print(json.dumps({"broken": str(error)}), file=said, flush=True)
        return 3
    report = report_of(flown, mission, "world", clock, "")
    print(json.dumps(report.model_dump(mode="json")), file=said, flush=True)
    return 0


def _drone(credentials: Callable[[int], Login], agent: int, endpoint: str, policy: str) -> int:
    """Where a bad network lets nobody in for a while it tries again, as a service does."""
    for _ in range(_TRIES):
        try:
            fly_agent(credentials(agent), endpoint, policy)
            return 0
        except SwarmError as error:
            if not any(word in str(error) for word in _TRY_AGAIN):
                print(f"agent {agent}: {error}", file=sys.stderr)
                return int(error.exit_code)
    return int(ExitCode.BROKEN)


def keys_for(protocol: str, agents: int) -> Keys:
    """The world's credentials, and a function from drones to their logins."""
    if protocol == "tcp":
        credentials = Credentials.fresh("rsc", agents)
        return credentials, credentials.login
    keys = make_keys("rsc", agents, [address(WORLD)], 1, datetime.now(UTC))
    return keys.world, lambda agent: keys.logins[agent]


def begin(
    wires: Wires, fields: Fields, clock: str, keys: Keys, protocol: str = "tcp", drones: bool = True
) -> Flight:
    """Start a world and, usually, its drones. Everything is loaded before, so that forked processes need not."""
    credentials, login = keys
    endpoint = f"{protocol}/{address(WORLD)}:7447"
    mine, theirs = os.pipe()
    world = wires.start(WORLD, lambda: _serve(fields, clock, credentials, endpoint, theirs))
    os.close(theirs)

    def start_drone(agent: int) -> int:
        return wires.start(agent + 1, lambda: _drone(login, agent, endpoint, fields.get("policy", "rsc-h20")))

    started = [start_drone(agent) for agent in range(fields["agents"] if drones else 0)]
    return Flight(wires, os.fdopen(mine), world, started, start_drone)
