"""How many frames a second a page shows of a large swarm: ``python -m tests.rsc_swarm.watch.frames [DRONES]``.

A simulation is flown before; then its pictures go to the page 25 times a second, as those of a flight would.
"""

import sys
import time

import psutil

from protocols.mission.document import Mission
from rsc_swarm.flight.simulate import Simulation
from rsc_swarm.watch.site import Asked, served
from tests.rsc_swarm.watch.browsers import Page, browser
from world.outlets.picture import picture, scene

_SECONDS, _EVERY = 8, 4


def _spent() -> float:
    """CPU time of the browser, all its processes, s."""
    each = [
        process.cpu_times()
        for process in psutil.Process().children(recursive=True)
        if "chrom" in process.name()
    ]
    return sum(times.user + times.system for times in each)


def main(drones: int) -> None:
    mission = Mission(
        agents=drones, obstacles={"discs": [(20, 0, 2), (30, 12, 1.5)]}, radio={"loss": 0.2}, fly_s=20
    )
    simulation, pictures = Simulation([mission], watched=True), []
    for _ in range(_SECONDS * 25):
        pictures.append(picture(simulation.world, simulation.director.statuses, 1.0).packed())
        for _ in range(_EVERY):
            simulation.tick()
    with browser() as chromium, served(Asked(port=0)) as site:
        site.window.say({"kind": "scene", "scene": scene(simulation.world)})
        page = Page(chromium, site.address)
        page.until("page.recording.scene")
        began, first = time.monotonic(), 0
        for number, each in enumerate(pictures):
            site.window.give(each)
            if number == 50:  # trails are long by now
                first, since, spent = page.value("page.frames()"), time.monotonic(), _spent()
            time.sleep(max(0.0, began + (number + 1) / 25 - time.monotonic()))
        shown = page.value("page.frames()") - first
        seconds, cpu_ms = time.monotonic() - since, 1e3 * (_spent() - spent) / max(shown, 1)
        how = page.value(
            """(() => { const gl = document.createElement("canvas").getContext("webgl");
            const info = gl?.getExtension("WEBGL_debug_renderer_info");
            return info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "no WebGL"; })()"""
        )
        print(
            f"{drones} drones: {shown / seconds:.1f} frames/s, {cpu_ms:.0f} ms of CPU each, rendered by {how}"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 250)
