"""How beacons of four peers arrive over the links that a fleet can have, with loss on the way (tests.scenarios.wires).

python -m tests.scenarios.links --loss 0.1 quic udp tls
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from agent.air.peers import AirLink, End, name_of
from protocols.wire.certificates import OPERATOR, make_peer_certificates
from protocols.wire.keys import user
from tests.scenarios.wires import Rules, Wires, address

_PEERS, _BEACONS, _EVERY_S, _BYTES = 4, 250, 0.04, 200
_PLAIN = ("udp", "tcp")


def measure(protocol: str, loss: float) -> tuple[float, np.ndarray]:
    """The share of beacons that were lost, and how long each of the others was under way, ms."""
    hosts = {OPERATOR: address(0)} | {user(peer): address(peer) for peer in range(_PEERS)}
    keys = {} if protocol in _PLAIN else make_peer_certificates("rsc", hosts, 1, datetime.now(UTC))
    with tempfile.TemporaryDirectory() as folder, Wires(_PEERS) as wires:
        wires.rule(Rules(loss=loss))

        def peer(me: int) -> Callable[[], int]:
            def run() -> int:
                at = [f"{protocol}/{address(other)}:7450" for other in range(me + 1)]
                link = AirLink("rsc", End(name_of(me), at.pop(), at), keys.get(user(me)), _PEERS)
                time.sleep(4.0)  # until all are linked
                for _ in range(_BEACONS):
                    link.say("beacon", (time.time_ns() // 1000).to_bytes(8, "big") + bytes(_BYTES - 8))
                    time.sleep(_EVERY_S)
                time.sleep(2.0)
                late = [
                    said.at_us - int.from_bytes(said.data[:8], "big")
                    for said in link.hear()
                    if said.who != name_of(me)
                ]
                np.save(Path(folder) / f"{me}.npy", np.array(late) / 1000)
                os._exit(0)

            return run

        for process in [wires.start(me, peer(me)) for me in range(_PEERS)]:
            wires.wait(process)
        late = np.concatenate([np.load(Path(folder) / f"{me}.npy") for me in range(_PEERS)])
    return 1 - len(late) / (_PEERS * (_PEERS - 1) * _BEACONS), late


def main() -> None:
    options = argparse.ArgumentParser()
    options.add_argument("--loss", type=float, default=0.0)
    options.add_argument("protocols", nargs="+", choices=["quic", "udp", "tls", "tcp"])
    chosen = options.parse_args()
    print("| link | lost | p50 ms | p95 ms | p99 ms | longest ms |\n| --- | --- | --- | --- | --- | --- |")
    for protocol in chosen.protocols:
        lost, late = measure(protocol, chosen.loss)
        figures = " | ".join(f"{np.quantile(late, share):.1f}" for share in (0.5, 0.95, 0.99, 1.0))
        print(f"| `{protocol}` | {100 * lost:.1f} % | {figures} |", flush=True)


if __name__ == "__main__":
    main()
