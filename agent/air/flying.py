"""A drone's process on the air: 100 times a second of the time of day, hear, step, say. A thin shell around AirDrone."""

import time
from collections.abc import Callable

from agent.air.clock import Utc
from agent.air.drone import AirDrone
from agent.air.peers import AirLink
from agent.air.pilot import IN_FLIGHT, Phase
from agent.air.trouble import Trouble

_TICK_US = 10_000


def fly(
    drone: AirDrone,
    link: AirLink,
    leaving: Callable[[], bool],
    on_phase: Callable[[Phase, tuple[str, ...]], None],
    trouble: Trouble,
    clock: Utc,
) -> None:
    """Be this drone until asked to leave. One that flies lands first. ``clock``: the link's.

    Raises:
        agent.air.vehicle.VehicleError: the vehicle cannot be reached any more; it is left to its own failsafe.
        agent.policy.PolicyError: the policy raised; the vehicle was told to land.
    """
    told, last = 0, 0
    while True:
        now_us = clock.us() + trouble.clock_us
        wait_us = _TICK_US - now_us % _TICK_US if now_us // _TICK_US == last else 0
        if wait_us:
            time.sleep(wait_us / 1e6)
            continue
        last, now = now_us // _TICK_US, time.monotonic()
        for said in link.hear():
            if not trouble.loses(drone.flown_s):
                drone.hear(said._replace(at_us=said.at_us + trouble.clock_us), now)
        try:
            for kind, data in drone.step(now_us, now):
                link.say(kind, data)
        except Exception:
            drone.give_up()
            raise
        for _, phase, reasons in drone.events[told:]:
            on_phase(phase, reasons)
        told = len(drone.events)
        if drone.pilot.phase is Phase.GROUND:
            clock.set()
        if leaving():
            if drone.pilot.phase not in IN_FLIGHT:
                return
            drone.land()
