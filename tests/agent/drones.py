"""A drone in this process that is told ticks as bytes, and frames of a real flight for it to hear."""

from typing import Any

from protocols.mission.document import parse_mission
from protocols.wire import messages
from protocols.wire.frames import FIXED
from protocols.wire.messages import (
    Reply,
    Tick,
    Welcome,
    make_tick,
)
from protocols.wire.sensed import SensedPacker, empty_sensed
from rsc_swarm.flight.simulate import Simulation
from tests.loopback import Hosted

MISSION = parse_mission({"agents": 6})
ME = 2
WELCOME = Welcome(0, MISSION.briefing(), bytes(range(6)), 0, bytes(8), b"", False)
POLICY = "rsc-h20"


def sensed() -> Any:
    rows = empty_sensed(1)
    rows.position[0], rows.velocity[0] = [1, 2], [3, 0.5]
    rows.near_count[0], rows.near[0, 0] = 1, (0, 3, 1, 0, 0)
    return SensedPacker(rows).pack(0)


def drone() -> Hosted:
    return Hosted(MISSION, ME, WELCOME)


def frames_of_a_flight(ticks: int = 30) -> list[bytes]:
    """What the others say in tick ``ticks`` - 1 of a real flight, in which slots are being traded."""
    simulation = Simulation([parse_mission({"agents": 6, "start": {"scrambled": True}, "seed": 6})])
    for _ in range(ticks):
        simulation.tick()
    first = (simulation.clock - 1) % simulation.world.ring * 6
    air = simulation._air
    return [air.pack(row) for row in range(first, first + 6) if air.frames.sender[row] != ME]


GOOD = frames_of_a_flight()
NOW = 30


def from_others(heard: list[bytes]) -> tuple[list[int], list[bytes]]:
    """The frames, and from whom they come: whom they name, or drone 1 where they name nobody."""
    place = FIXED.fields["sender"][1]
    return [data[place] if len(data) > FIXED.itemsize else 1 for data in heard], heard


def ticked(tick: int, heard: list[bytes]) -> Tick:
    return make_tick(tick, 0, tick - 1, sensed(), *from_others(heard))


def reply(answer: bytes) -> Reply:
    said = messages.unpack_from_drone(answer, 6)
    assert isinstance(said, Reply)
    return said


def answers(heard: list[bytes], ticks: int = 3) -> tuple[list[Reply], dict[str, int]]:
    """A drone's answers to some ticks in a row, without its account of itself; what it has rejected."""
    one, times = drone(), range(NOW, NOW + ticks)
    said = [one.answer(ticked(tick, heard if tick == NOW else [])) for tick in times]
    return [reply(answer)._replace(status=None) for answer in said], one.drone.rejected
