"""How beacons of four peers arrive over the links that a fleet can have, with loss on the way (tests.scenarios.wires).

python -m tests.scenarios.links --loss 0.1 --parted 3 quic udp tls
python -m tests.scenarios.links --loss 0.3 --starts 20 quic       how soon seven who start at once hear each other
"""

import argparse
import math
import os
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from agent.air.peers import AirLink, End, name_of
from protocols.wire.certificates import OPERATOR, make_peer_certificates
from protocols.wire.keys import user
from rsc_swarm.machine.priority import go_first
from tests.scenarios.wires import Rules, Wires, address

_PEERS, _EVERY_S, _BYTES = 4, 0.04, 200
_STARTING, _PATIENCE_S = 7, 25.0  # a fleet of six and its operator
_BEFORE_S, _AFTER_S = 10.0, 9.0  # a cut
_PLAIN = ("udp", "tcp")


class Measured(NamedTuple):
    """lost: share of beacons. late_ms: how long each of the others was under way. again_s: of each link from and to the peer that
    was cut off, from the cut's end until the first beacon that was said after it; infinite: never."""

    lost: float
    late_ms: np.ndarray
    again_s: np.ndarray


def measure(protocol: str, loss: float, parted_s: float = 0.0) -> Measured:
    """Beacons of all peers, the last of which is cut off for so long in the middle; what was said meanwhile does not count."""
    hosts = {OPERATOR: address(0)} | {user(peer): address(peer) for peer in range(_PEERS)}
    keys = {} if protocol in _PLAIN else make_peer_certificates("rsc", hosts, 1, datetime.now(UTC))
    beacons = round((_BEFORE_S + (parted_s and parted_s + _AFTER_S)) / _EVERY_S)
    with tempfile.TemporaryDirectory() as folder, Wires(_PEERS) as wires:
        wires.rule(Rules(loss=loss))

        def peer(me: int) -> Callable[[], int]:
            def run() -> int:
                go_first()
                at = [f"{protocol}/{address(other)}:7450" for other in range(_PEERS)]
                others = [(name_of(other), "beacon") for other in range(_PEERS) if other != me]
                end = End(name_of(me), at.pop(me), at, others)
                link = AirLink("rsc", end, keys.get(user(me)), _PEERS)
                (Path(folder) / f"{me}.up").touch()
                time.sleep(4.0)  # until all are linked
                said_us, came = [], []
                for _ in range(beacons):
                    said_us.append(time.time_ns() // 1000)
                    link.say("beacon", said_us[-1].to_bytes(8, "big") + bytes(_BYTES - 8))
                    time.sleep(_EVERY_S)
                    came += link.hear()
                np.save(Path(folder) / f"said-{me}.npy", np.array(said_us))
                time.sleep(2.0)
                came += link.hear()
                heard = [(int(said.who), int.from_bytes(said.data[:8], "big"), said.at_us) for said in came]
                np.save(
                    Path(folder) / f"{me}.npy",
                    np.array([row for row in heard if row[0] != me]).reshape(-1, 3),
                )
                os._exit(0)

            return run

        processes = [wires.start(me, peer(me)) for me in range(_PEERS)]
        cut = healed = math.inf
        if parted_s:
            while len(list(Path(folder).glob("*.up"))) < _PEERS:
                time.sleep(0.01)
            time.sleep(4.0 + _BEFORE_S)
            cut = time.time_ns() // 1000
            wires.rule(Rules(loss=loss, cut=(_PEERS - 1,)))
            time.sleep(parted_s)
            wires.rule(Rules(loss=loss))
            healed = time.time_ns() // 1000
        for process in processes:
            wires.wait(process)
        heard = [np.load(Path(folder) / f"{me}.npy") for me in range(_PEERS)]
        to_all = [np.load(Path(folder) / f"said-{me}.npy") < cut for me in range(_PEERS)]
        said = (_PEERS - 1) * sum(int(early.sum()) for early in to_all)
    before = np.concatenate([rows[rows[:, 1] < cut] for rows in heard])
    again = [_first_after(heard[to], by, healed) for to in range(_PEERS) for by in range(_PEERS)
             if to != by and _PEERS - 1 in (to, by)]  # fmt: skip
    return Measured(1 - len(before) / said, (before[:, 2] - before[:, 1]) / 1000, np.array(again))


def started(protocol: str, loss: float) -> list[float]:
    """Of all pairs of seven on four machines who start at once: when one hears the other first [s]; infinite: never."""
    machines = [0, *(1 + drone // 2 for drone in range(_STARTING - 1))]
    hosts = {OPERATOR: address(0)} | {user(peer): address(machines[peer]) for peer in range(_STARTING)}
    keys = {} if protocol in _PLAIN else make_peer_certificates("rsc", hosts, 1, datetime.now(UTC))
    with tempfile.TemporaryDirectory() as folder, Wires(4, time.time_ns() % 100_000) as wires:
        wires.rule(Rules(loss=loss))

        def peer(me: int) -> Callable[[], int]:
            def run() -> int:
                at = [f"{protocol}/{address(machines[other])}:{7450 + other}" for other in range(_STARTING)]
                others = [(name_of(other), "beacon") for other in range(_STARTING) if other != me]
                link = AirLink("rsc", End(name_of(me), at.pop(me), at, others), keys.get(user(me)), _STARTING)
                began, first = time.monotonic(), dict[str, float]()
                while (now := time.monotonic() - began) < _PATIENCE_S:
                    link.say("beacon", bytes(_BYTES))
                    for said in link.hear():
                        first.setdefault(said.who, now)
                    if len(first) == len(others):
                        (Path(folder) / f"{me}.all").touch()
                    if len(list(Path(folder).glob("*.all"))) == _STARTING:
                        break
                    time.sleep(_EVERY_S)
                np.save(Path(folder) / f"{me}.npy", [first.get(other, math.inf) for other, _ in others])
                os._exit(0)

            return run

        for process in [wires.start(machines[me], peer(me)) for me in range(_STARTING)]:
            wires.wait(process)
        return [float(after) for me in range(_STARTING) for after in np.load(Path(folder) / f"{me}.npy")]


def _tell_starts(protocol: str, loss: float, starts: int) -> None:
    after = np.sort(np.concatenate([started(protocol, loss) for _ in range(starts)]))
    figures = " | ".join(f"{after[int(share * len(after))]:.2f}" for share in (0.5, 0.95, 0.99))
    print(
        f"| `{protocol}` | {100 * loss:g} % | {figures} | {np.isinf(after).sum()} of {len(after)} |",
        flush=True,
    )


def _first_after(rows: np.ndarray, by: int, healed_us: float) -> float:
    arrivals = rows[(rows[:, 0] == by) & (rows[:, 1] > healed_us), 2]
    return float(arrivals.min() - healed_us) / 1e6 if len(arrivals) else math.inf


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--loss", type=float, default=0.0)
    options.add_argument("--parted", type=float, default=0.0)
    options.add_argument("protocols", nargs="+", choices=["quic", "udp", "tls", "tcp"])
    options.add_argument("--starts", type=int, default=0)
    chosen = options.parse_args()
    if chosen.starts:
        print(
            "| link | loss | half are heard after s | 95 % | 99 % | not within 25 s |\n| --- | --- | --- | --- | --- | --- |"
        )
        for protocol in chosen.protocols:
            _tell_starts(protocol, chosen.loss, chosen.starts)
        return
    again = " heard again after s, half of them | all |" if chosen.parted else ""
    print(f"| link | lost | p50 ms | p95 ms | p99 ms | longest ms |{again}")
    print("| --- | --- | --- | --- | --- | --- |" + " --- | --- |" * bool(again))
    for protocol in chosen.protocols:
        lost, late, waited = measure(protocol, chosen.loss, chosen.parted)
        figures = " | ".join(f"{np.quantile(late, share):.1f}" for share in (0.5, 0.95, 0.99, 1.0))
        told = f" {np.median(waited):.2f} | {waited.max():.2f} |" if chosen.parted else ""
        print(f"| `{protocol}` | {100 * lost:.1f} % | {figures} |{told}", flush=True)


if __name__ == "__main__":
    main()
