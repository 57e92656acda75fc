"""What a radio host with three Crazyflies costs, and what a drone's process costs beside it: ``python -m tests.radiohost.cost``.

Six fakes hover, led by the processes of a real fleet (examples/room.yaml). Processor time, not time: other work on the machine
changes it little, as long as there is some left.
"""

import sys
import tempfile
import time
from pathlib import Path

import psutil
import yaml

from tests.fakes.crazyflie import FakeCrazyflie
from tests.fakes.udp import Wires
from tests.scenarios.fleets import EXAMPLES, Fleet, drone_processes

SECONDS = 15.0
PATIENCE = {
    "position_hold_s": 1.0, "position_land_s": 5.0, "clock_hold_ms": 500, "clock_land_ms": 2000, "jump_m": 1.5, "hold_s": 60.0,
}  # fmt: skip


def main() -> None:
    room = yaml.safe_load((EXAMPLES / "room.yaml").read_text())["drones"]
    fakes = [FakeCrazyflie((*drone["start_m"], 0.0)) for drone in room]
    with Wires(fakes) as wires, tempfile.TemporaryDirectory() as folder:
        drones = [
            drone | {"body": f"crazyflie:udp://127.0.0.1:{port}", "dongle": 91 + drone["number"] // 3}
            for drone, port in zip(room, wires.ports, strict=True)
        ]
        fleet = Fleet(Path(folder), drones=drones, guard=PATIENCE)
        with fleet.in_the_air() as air:
            operator = fleet.operator(f"preflight,arm,takeoff,wait={SECONDS + 10:g},land")
            while sum(fake.motion.p[2] > 0.5 for fake in fakes) < len(fakes):
                if operator.poll() is not None:
                    sys.exit(f"they do not hover:\n{fleet.told}{fleet.log}")
                time.sleep(0.1)
            children = [psutil.Process(pid) for pid in drone_processes(air).values()]
            before, begun = [sum(one.cpu_times()[:2]) for one in children], time.monotonic()
            time.sleep(SECONDS)
            taken = time.monotonic() - begun
            for one, earlier in zip(children, before, strict=True):
                kind = (
                    "radio host with three Crazyflies" if "rsc_swarm.radiohost" in one.cmdline() else "drone"
                )
                share = (sum(one.cpu_times()[:2]) - earlier) / taken
                memory = one.memory_full_info().pss / 1e6
                print(f"{kind:33s} {100 * share:4.1f} % of a core, {memory:3.0f} MB")
            operator.wait()
            print(fleet.told.strip())


if __name__ == "__main__":
    main()
