"""Flights over bad networks (tests.scenarios.machines): a command that makes the figures of docs/networks.md.

python -m tests.scenarios.networks stories                                  what docs/networks.md tells of cuts and stops
python -m tests.scenarios.networks flights --flights 100 --loss 0.1         ... and of many flights
"""

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from protocols.mission.document import parse_mission
from rsc_swarm.flight.simulate import simulate
from rsc_swarm.flight.warm_up import warm_up
from tests.scenarios.machines import GOOD, WORLD, Fields, begin, keys_for
from tests.scenarios.wires import Rules, Wires, why_not

# Never at its goal, so that it is in the air when something happens.
LONG: Fields = {"agents": 4, "goal_x_m": 1e6, "obstacles": {"discs": []}}


@dataclass(frozen=True)
class Told:
    """What came of one story."""

    network: str
    clock: str
    good: bool
    what: str


def _lost(report: Fields) -> list[int]:
    return list(report.get("lost_agents", ["everybody"]))


def lockstep(seconds: float, stopped_s: float, expected_digest: str, fly_s: float) -> list[Told]:
    """One flight in which one link is cut, then all, then the world stopped, then all connections broken: in lockstep it is the
    same flight as without all that."""
    with Wires(5) as wires:
        flight = begin(wires, {**LONG, "fly_s": fly_s}, "lockstep", keys_for("tcp", 4))
        told, lasted = [], {}
        for at, (name, happen) in enumerate(
            {
                f"one link cut for {seconds:g} s": lambda: flight.for_a_while(seconds, Rules(cut=(2,))),
                f"the world cut from all for {seconds:g} s": lambda: flight.for_a_while(
                    seconds, Rules(cut=(WORLD,))
                ),
                f"the world stopped for {stopped_s:g} s": lambda: flight.stop_world(stopped_s),
                "every TCP connection broken": lambda: wires.reset_connections(WORLD),
            }.items()
        ):
            flight.await_tick(50 + 100 * at)
            began = time.monotonic()
            happen()
            healed = time.monotonic()
            flight.await_tick(flight.tick + 30)
            lasted[name] = time.monotonic() - healed, healed - began
        report = flight.report()
    same = report.get("digest") == expected_digest
    for name, (after, _) in lasted.items():
        lost = "nobody lost" if not _lost(report) else f"lost {_lost(report)}"
        what = f"{lost}, {'the same digest' if same else f'ANOTHER flight ({report})'}; goes on within {after:.1f} s"
        told.append(Told(name, "lockstep", same and not _lost(report), what))
    return told


def realtime_cut(
    seconds: float, cut: tuple[int, ...], name: str, network: Rules = GOOD, protocol: str = "tcp"
) -> Told:
    """Some machines are cut off in mid-flight; nobody is lost, and everybody takes part again within a second."""
    with Wires(5) as wires:
        wires.rule(network)
        flight = begin(wires, {**LONG, "fly_s": 5 + seconds}, "realtime", keys_for(protocol, 4), protocol)
        flight.await_tick(200)
        flight.for_a_while(seconds, replace(network, cut=cut), network)
        report = flight.report()
    return _back_in_time(report, f"{name} cut for {seconds:g} s{_worded(network)}", seconds)


def _worded(network: Rules) -> str:
    if not network.loss and not network.delay_s:
        return ""
    return f", {network.loss:.0%} loss, {1e3 * network.delay_s:g} +- {1e3 * network.jitter_s:g} ms each way"


def _back_in_time(report: Fields, name: str, seconds: float) -> Told:
    ages = report.get("commands") or {"longest_s": [9e9], "braked_s": [0], "p99_s": 0}
    longest = max(ages["longest_s"])
    good = not _lost(report) and longest <= seconds + 1
    lost = "nobody lost" if not _lost(report) else f"lost {_lost(report)} ({report.get('detail', report)})"
    what = f"{lost}; oldest command {longest:.2f} s, braked for at most {max(ages['braked_s']):.2f} s"
    return Told(name, "realtime", good, what)


def world_stopped(seconds: float) -> Told:
    with Wires(5) as wires:
        flight = begin(wires, {**LONG, "fly_s": 6}, "realtime", keys_for("tcp", 4))
        flight.await_tick(200)
        flight.stop_world(seconds)
        report = flight.report()
    return _back_in_time(report, f"the world stopped for {seconds:g} s", 0.0)


def drone_restarted(clock: str) -> Told:
    """A drone's process is killed and started again: it takes its place and flies on."""
    with Wires(5) as wires:
        flight = begin(wires, {**LONG, "fly_s": 9}, clock, keys_for("tcp", 4))
        flight.await_tick(200)
        flight.restart_drone(2)
        began, tick = time.monotonic(), flight.tick
        if clock == "lockstep":
            flight.await_tick(tick + 100)
        report = flight.report()
        away = time.monotonic() - began
    if clock == "realtime":
        away = max((report.get("commands") or {"longest_s": [9e9]})["longest_s"])
    lost = "nobody lost" if not _lost(report) else f"lost {_lost(report)} ({report.get('detail', report)})"
    return Told(
        "a drone's process killed and started again",
        clock,
        not _lost(report),
        f"{lost}; back after {away:.1f} s at most",
    )


def world_restarted() -> Told:
    """The world is killed and started anew: its drones say so, end with exit code 3, and can be started again."""
    with Wires(5) as wires:
        keys = keys_for("tcp", 4)
        flight = begin(wires, {**LONG, "fly_s": 30}, "lockstep", keys)
        flight.await_tick(100)
        os.kill(flight.world, signal.SIGKILL)
        wires.wait(flight.world)
        began = time.monotonic()
        again = begin(wires, {**LONG, "fly_s": 1}, "lockstep", keys, drones=False)
        codes = [wires.wait(drone) for drone in flight.drones]
        took = time.monotonic() - began
        again.drones = [again.start_drone(agent) for agent in range(4)]
        report = again.report()
    good = codes == [3] * 4 and not _lost(report)
    return Told(
        "the world killed and started anew",
        "both",
        good,
        f"drones leave with exit codes {codes} within {took:.1f} s; the next flight flies",
    )


def many(flights: int, fields: Fields, network: Rules, seed_base: int, protocol: str) -> Told:
    """Whole flights in real time over one network."""
    ends: dict[str, int] = {}
    closest, oldest, p99, missed = 9e9, 0.0, 0.0, []
    for number in range(flights):
        task = {**fields, "map_seed": seed_base + number, "seed": number}
        with Wires(fields["agents"] + 1, number) as wires:
            wires.rule(network)
            report = begin(wires, task, "realtime", keys_for(protocol, fields["agents"]), protocol).report()
        end = "success" if report.get("success") else report.get("failure") or "broken"
        ends[end] = ends.get(end, 0) + 1
        if "commands" in report:
            closest = min(closest, report["min_distance_m"])
            oldest, p99 = max(oldest, *report["commands"]["longest_s"]), max(p99, report["commands"]["p99_s"])
            if end != "success":
                missed.append(f"map {task['map_seed']}: {report['detail']}")
        else:
            missed.append(str(report))
        print(
            f"\r{number + 1} flights: {ends}, closest {closest:.2f} m  ", end="", file=sys.stderr, flush=True
        )
    for line in missed:
        print(f"\n{line}", file=sys.stderr)
    ended = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    ages = f"99 % of commands at most {p99:.2f} s old, the oldest {oldest:.2f} s"
    what = f"{flights} flights: {ended}; closest {closest:.2f} m, {ages}"
    return Told(
        _worded(network).lstrip(", ") or "no loss, no delay", "realtime", "collision" not in ends, what
    )


def digest_of(fly_s: float) -> str:
    """Of the same flight in one process."""
    return simulate([parse_mission({**LONG, "fly_s": fly_s})])[0].digest


def stories(seconds: float, stopped_s: float) -> dict[str, Callable[[], list[Told] | Told]]:
    """All of them, with cuts and stops as long as this."""
    bad, fly_s = Rules(0.1, 0.05, 0.01), 8.0
    return {
        "lockstep": lambda: lockstep(seconds, stopped_s, digest_of(fly_s), fly_s),
        "link": lambda: realtime_cut(seconds, (2,), "one link"),
        "world": lambda: realtime_cut(seconds, (WORLD,), "the world"),
        "bad-link": lambda: realtime_cut(seconds, (2,), "one link", bad),
        "quic-link": lambda: realtime_cut(seconds, (2,), "one link (quic)", bad, "quic"),
        "stopped": lambda: world_stopped(stopped_s),
        "drone-lockstep": lambda: drone_restarted("lockstep"),
        "drone-realtime": lambda: drone_restarted("realtime"),
        "new-world": world_restarted,
    }


def _show(told: list[Told] | Told) -> bool:
    rows = told if isinstance(told, list) else [told]
    for row in rows:
        print(f"| {row.network} | {row.clock} | {'' if row.good else 'FAILED: '}{row.what} |", flush=True)
    return all(row.good for row in rows)


def main() -> int:
    parser = argparse.ArgumentParser(
        description="Fly over bad networks, in network namespaces of this machine."
    )
    parser.add_argument("what", choices=["stories", "flights"])
    parser.add_argument("names", nargs="*", help="of stories; none: all")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long links are cut")
    parser.add_argument("--stopped-s", type=float, default=10.0, help="how long the world is stopped")
    parser.add_argument("--flights", type=int, default=10)
    parser.add_argument("--agents", type=int, default=4)
    parser.add_argument("--policy", default="rsc-h20")
    parser.add_argument("--loss", type=float, default=0.0)
    parser.add_argument("--delay-ms", type=float, default=50.0)
    parser.add_argument("--jitter-ms", type=float, default=10.0)
    parser.add_argument("--protocol", choices=["tcp", "tls", "quic"], default="tcp")
    parser.add_argument("--seed-base", type=int, default=1_000_000)
    parser.add_argument("--set", type=json.loads, default={}, help="fields of the mission, as JSON")
    asked = parser.parse_args()
    if reason := why_not():
        print(f"no bad networks here: {reason}", file=sys.stderr)
        return 2
    warm_up(parse_mission({"agents": asked.agents, "policy": asked.policy}))
    if asked.what == "stories":
        told = stories(asked.seconds, asked.stopped_s)
        shown = [_show(told[name]()) for name in asked.names or told]
        return 0 if all(shown) else 1
    network = Rules(asked.loss, asked.delay_ms / 1e3, asked.jitter_ms / 1e3)
    fields = {"agents": asked.agents, "policy": asked.policy, **asked.set}
    return 0 if _show(many(asked.flights, fields, network, asked.seed_base, asked.protocol)) else 1


if __name__ == "__main__":
    sys.exit(main())
