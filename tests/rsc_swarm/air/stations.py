"""An operator's station that hears a fleet as a test wants it."""

from pathlib import Path

from agent.air.peers import Said, name_of
from agent.air.pilot import Phase
from agent.air.vehicle import Mode, Vector
from protocols.wire.account import Account
from protocols.wire.beacon import NO_TICK, Beacon, pack_beacon
from rsc_swarm.air.plans import read_plan
from rsc_swarm.air.station import Station

ROOM = Path(__file__).parents[3] / "examples" / "room.yaml"
DRONES = 6


def station() -> Station:
    """Of the example's operator, who has heard nobody yet."""
    return Station(read_plan(ROOM), "1", 0)


def hear(
    station: Station,
    now: float,
    *phases: Phase,
    complaints: tuple[str, ...] = (),
    late_s: float = 0.0,
    p: Vector = (0.0, 0.0, 0.0),
) -> None:
    """All drones say what they are doing: each its own, or all the same. late_s: the operator's clock minus theirs."""
    plan, utc_us = station.plan, round(1e6 * now)
    for me, phase in enumerate(phases if len(phases) > 1 else DRONES * phases):
        others = tuple(drone for drone in range(DRONES) if drone != me)
        account = Account(
            drone=me, phase=phase, mode=Mode.GROUND, complaints=complaints, reasons=("climbed",), heard=others, clock_ms=0.0,
            slot=me, ticks=0, missed=0, rejected=0, fleet=plan.fleet_digest, mission=plan.mission_digest, version="1",
        )  # fmt: skip
        beacon = Beacon(
            me, list(Phase).index(phase), me, NO_TICK, utc_us, p, (0.0, 0.0, 0.0), 10, 0, 0, 90, False
        )  # fmt: skip
        for kind, data in (("beacon", pack_beacon(beacon)), ("account", account.to_json())):
            station.hear(Said(name_of(me), kind, data, utc_us + round(1e6 * late_s)), now)
