"""What a live page costs a flight, in CPU time: ``python -m tests.rsc_swarm.watch.cost [DRONES]``.

What is added to a tick of the world, what a picture costs the world's process, and what it costs the process that serves the
page, with one page that reads.
"""

import statistics
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace

import psutil
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from protocols.mission.document import Mission
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.watch.site import Asked, served
from world.outlets.picture import picture

_TICKS, _PICTURES = 400, 200


def main(drones: int) -> None:
    mission = Mission(agents=drones)
    flights = [Simulation([mission]), Simulation([mission], watched=True)]
    ticks: list[list[float]] = [[], []]
    for _ in range(_TICKS):
        for flight, spent in zip(flights, ticks, strict=True):
            began = time.thread_time()
            flight.tick()
            spent.append(time.thread_time() - began)
    core, statuses = flights[1].world, flights[1].director.statuses
    shown = picture(core, statuses, 1.0)
    making = []
    with served(Asked(port=0)) as site:
        (server,) = psutil.Process().children()
        with connect(site.address.split("#")[0].replace("http", "ws") + "live", max_size=None) as page:
            site.window.say({"kind": "scene"})
            page.recv()
            before = server.cpu_times()
            reader = threading.Thread(target=_read, args=(page,))
            reader.start()
            for number in range(_PICTURES):
                began = time.thread_time()
                site.window.show(replace(picture(core, statuses, 1.0), tick=shown.tick + number).packed())
                making.append(time.thread_time() - began)
                time.sleep(0.02)
            after = server.cpu_times()
        reader.join()
    added = statistics.median(watched - alone for alone, watched in zip(*ticks, strict=True))
    serving = (after.user + after.system - before.user - before.system) / _PICTURES
    print(
        f"{drones} drones: {1e3 * added:.2f} ms more a tick; a picture of {len(shown.packed()) / 1e3:.1f} kB: "
        f"{1e3 * statistics.median(making):.2f} ms to make, {1e3 * serving:.2f} ms to serve"
    )


def _read(page: ClientConnection) -> None:
    with suppress(ConnectionClosed):
        while True:
            page.recv()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 25)
