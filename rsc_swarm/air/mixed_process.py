"""The world's process in mixed reality: a thin shell around MixedWorld."""

import time
from pathlib import Path

from agent.air.clock import Utc
from agent.air.peers import AirLink, end_of
from protocols.fleet.document import host_of
from protocols.fleet.plan import Plan
from protocols.mission.document import Mission
from protocols.wire.nature import WORLD
from rsc_swarm.air.mixed import MixedWorld
from rsc_swarm.flight.alone import UNWATCHED, Watching
from rsc_swarm.flight.key_files import read_world_login
from rsc_swarm.flight.warm_up import warm_up
from rsc_swarm.flight.world_process import save_path
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.machine.priority import go_first
from rsc_swarm.machine.service import Service
from world.outcome import Flown
from world.outlets.snapshot import snapshot

_TICK_US = 10_000
_PHASE_US = 5_000  # after a tick begins: by then the drones have said what they say in it
_SHOW_S = 0.125


def serve_mixed(
    plan: Plan,
    mission: Mission,
    keys: Path | None,
    watching: Watching = UNWATCHED,
    run_dir: Path | None = None,
) -> tuple[Flown, str | None]:
    """Be the world of a fleet for one flight: until all are down again, or until asked to leave.

    Args:
        mission: as rsc_swarm.air.mixed.mixed_mission makes it. keys: the folder of keys, if the fleet has some.

    Returns:
        The flight, and why its path could not be written into ``run_dir``.

    Raises:
        protocols.wire.keys.LinkError: the world's address cannot be listened at.
        rsc_swarm.flight.key_files.KeyFileError: of its keys. world.field.FieldError: the mission leaves no room to start.
        KeyboardInterrupt: asked to leave before the mission had begun.
    """
    warm_up(mission)
    end, swarm = end_of(plan.fleet, WORLD), plan.mission.swarm
    own = read_world_login(keys, swarm, host_of(end.listen)).certificates if keys else None
    world, service, clock = MixedWorld(plan, mission), Service(), Utc()
    go_first()
    with leave_when_asked() as leave, AirLink(swarm, end, own, mission.agents, clock) as link:
        service.ready(f"the world of {mission.agents} drones at {end.listen}")
        shown = last = 0.0
        while not (service.alive(leave.asked) or world.down(time.monotonic())):
            now_us = clock.us() - _PHASE_US
            if now_us // _TICK_US == last:
                time.sleep((_TICK_US - now_us % _TICK_US) / 1e6)
                continue
            last, now = now_us // _TICK_US, time.monotonic()
            for said in link.hear():
                world.hear(said, now)
            for kind, data in world.tick(now_us, now):
                link.say(kind, data)
            if world.begun and now - shown > _SHOW_S:
                shown = now
                watching.on_snapshot(snapshot(world.core, world.director.statuses, 1.0))
        world.leave()
    if not world.begun:
        raise KeyboardInterrupt
    flown = world.flown()
    return flown, save_path(world.recorder, run_dir, flown)
