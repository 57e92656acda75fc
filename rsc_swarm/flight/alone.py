"""Flying on several machines: the world alone, or one drone alone, each the only one of its flight in this process. Many drones:
rsc_swarm.flight.agents.

Both tell a service manager that they are ready, and ping its watchdog from the loop that flies: one that hangs is ended.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from agent.body.relayed import Ending
from agent.policy import PolicyError
from agent.process import fly
from agent.radio.link import AgentLink
from protocols.mission.document import Mission, parse_mission
from protocols.wire.keys import LinkError
from protocols.wire.login import Login
from rsc_swarm.flight.launch import RunBroken
from rsc_swarm.flight.warm_up import warm_up, warm_up_drone
from rsc_swarm.flight.world_process import save_path
from rsc_swarm.machine.census import age_s
from rsc_swarm.machine.leaving import leave_when_asked
from rsc_swarm.machine.limits import make_room
from rsc_swarm.machine.service import Service
from world.outcome import Flown
from world.outlets.onlooker import Onlooker
from world.outlets.recorder import Recorder
from world.outlets.snapshot import Snapshot
from world.server.credentials import Credentials
from world.server.link import WorldLink
from world.server.ports import NoControl, ServerError
from world.server.session import Clock, WorldServer

_JOIN_S = 10.0  # patience of a drone alone that looks for its world


class Watching(NamedTuple):
    """Who is told of a flight while it lasts: of pictures for a terminal, of how many drones are ready; who looks on."""

    on_snapshot: Callable[[Snapshot], None] = lambda picture: None
    on_gathered: Callable[[int], None] = lambda ready: None
    onlooker: Onlooker | None = None


UNWATCHED = Watching()


def serve_world(
    mission: Mission,
    clock: Clock,
    listen: Sequence[str],
    credentials: Credentials,
    watching: Watching = UNWATCHED,
    run_dir: Path | None = None,
    join_s: float = 120.0,
) -> tuple[Flown, str | None]:
    """Be the world alone: wait for all drones, fly.

    Returns:
        The flight, and why its path could not be written into ``run_dir``.

    Raises:
        RunBroken: it cannot listen there, or drones did not come. KeyboardInterrupt: asked to leave before all had come.
    """
    make_room(mission.agents)
    warm_up(mission)
    recorder = Recorder(mission) if run_dir else None
    service = Service()
    with leave_when_asked() as leave:
        try:
            with WorldLink(credentials, listen, clock == "realtime") as link:
                service.ready(f"waiting for {mission.agents} drones")
                control = NoControl(
                    lambda: service.alive(leave.asked), watching.on_gathered, watching.on_snapshot
                )
                record = recorder.record if recorder else None
                flown = WorldServer(mission, link, clock, control, record, join_s, watching.onlooker).run()
        except (ServerError, LinkError) as error:
            if leave.asked:
                raise KeyboardInterrupt from None
            raise RunBroken(str(error)) from None
        return flown, save_path(recorder, run_dir, flown)


def fly_agent(
    login: Login, endpoint: str, policy: str, on_ready: Callable[[float], None] = lambda seconds: None
) -> Ending:
    """Be one drone alone, as on its companion computer, and fly ``policy``; return why the flight ended.

    Raises:
        RunBroken: no world there, the login is refused, or the world fell silent.
        rsc_swarm.machine.limits.MachineError: the machine gives too little.
        agent.policy.PolicyError: the policy cannot be had here, or raised.
    """
    refuse_unsealed(login)
    make_room(1)
    warm_up_drone(parse_mission({"agents": 4, "policy": policy}))  # who leaves before has nothing to lose
    service = Service()
    service.ready(f"looking for the world at {endpoint}")

    def tell() -> None:
        on_ready(age_s())

    with leave_when_asked(patient=False) as leave:
        return take_part(login, endpoint, policy, lambda: service.alive(leave.asked), _JOIN_S, tell)


def refuse_unsealed(login: Login) -> None:
    """Raises RunBroken if nobody could believe the swaps of who has this login."""
    if login.seals is None:
        raise RunBroken(
            f"agent {login.agent}: its login has no keys to seal swaps with; make new ones as this one was made"
        )


def take_part(
    login: Login,
    endpoint: str,
    policy: str,
    leaving: Callable[[], bool],
    join_s: float,
    on_linked: Callable[[], None],
) -> Ending:
    """Fly in the flight of the world at ``endpoint``, which is there within ``join_s``; why that ended. Raises as `fly_agent`."""
    try:
        with AgentLink(endpoint, login, join_s, leaving) as link:
            on_linked()
            reason = fly(link, login.agent, policy, leaving, seals=login.seals)
    except PolicyError:
        raise
    except (LinkError, ValueError) as error:
        if leaving():
            return Ending.ASKED_TO_LEAVE
        raise RunBroken(str(error)) from None
    if reason is Ending.WORLD_SILENT:
        raise RunBroken(f"agent {login.agent}: {reason}")
    return reason
