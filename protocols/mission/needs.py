"""What the numbers of a mission need of each other: how long frames take, and how long a flight.

A time that a mission leaves out is what these say, or the usual one where that is longer; one that is given must be at
least what these say (protocols.mission.checks).
"""

import math

from protocols.dynamics import TICK_S, TICKS_PER_S, ticks_of
from protocols.mission.fields import MissionFields, Radio
from protocols.mission.values import LONGEST_S
from protocols.wire.frames import AGE_UNIT_TICKS, AGE_WINDOW

USUAL_MEMORY_S, USUAL_ANSWER_S, USUAL_SILENCE_S, USUAL_LIMIT_S = 0.5, 0.5, 4.0, 21.0
_OUT_OF_REACH_S = 3.5  # so long the obstacles may keep a drone out of everybody's range
_CHANCE = 0.01  # of a chain of frames that is longer than we wait for
_HELD_BACK_TICKS = 5  # a frame out of order waits no longer (world.medium.medium)
_SLACK = 1.2  # of the usual time limit over the least: the way around obstacles


def frame_ticks(rate_hz: float) -> int:
    """Ticks from one frame of a drone to its next at the rate nearest to ``rate_hz`` that can be flown.

    However low the rate is: no more than one tick longer than the longest mission.
    """
    return max(1, round(min(TICKS_PER_S / rate_hz, ticks_of(LONGEST_S) + 1)))


def way_ticks(radio: Radio) -> int:
    """The longest a frame is under way, in ticks."""
    delay = math.ceil((radio.delay_ms + radio.jitter_ms) / (1000 * TICK_S) - 1e-9)
    return 1 + delay + (_HELD_BACK_TICKS if radio.reorder else 0)


def memory_ticks(radio: Radio) -> int:
    """A frame must be believed until the next has come."""
    return frame_ticks(radio.frame_rate_hz) + way_ticks(radio)


def answer_ticks(radio: Radio) -> int:
    """A proposal must wait until it was told and its answer was told."""
    return 2 * memory_ticks(radio)


def silence_ticks(radio: Radio, agents: int) -> int:
    """How long nothing may be heard of a drone that lives and has somebody in range.

    Its frame must reach one go-between, whose frames then tell of `AGE_WINDOW` drones each, in turn over all. So many frames
    are lost on the way that all but `_CHANCE` of such chains have got through; a bad spell of a link is sat out likewise.
    """
    lost = 1 - (1 - radio.loss) * (1 - radio.burst.loss)
    if lost >= 1:
        return ticks_of(LONGEST_S)
    tries = max(1.0, math.log(_CHANCE) / math.log(lost)) if lost > 0 else 1.0
    frames = 1 + math.ceil(agents / AGE_WINDOW)
    spell = radio.burst.length_s * -math.log(_CHANCE) * TICKS_PER_S if radio.burst.loss else 0.0
    heard = frames * frame_ticks(radio.frame_rate_hz) * tries + spell
    # What is a whole number but for the logarithms' last digit, which is the C library's, is that number.
    return min(math.ceil(heard - 1e-9) + AGE_UNIT_TICKS + 2 * way_ticks(radio), ticks_of(LONGEST_S))


def usual_silence_ticks(radio: Radio, agents: int) -> int:
    """The usual silence, or longer where frames are rare or get lost: no drone that lives is taken for dead."""
    longer = ticks_of(_OUT_OF_REACH_S) + silence_ticks(radio, agents)
    return min(max(ticks_of(USUAL_SILENCE_S), longer), ticks_of(LONGEST_S))


def least_flight_s(mission: MissionFields) -> float:
    """Seconds before which the formation cannot be beyond the goal line: its rear slot flies with the target.

    Infinite where the target never brings it there. Slots whose drones are killed may stay empty; the rest may be ahead of
    their places by the tolerance of an edge.
    """
    ahead = mission.edge_tolerance * mission.formation.spacing_m
    return _when(_goal_m(mission, certain=True) - _rear_m(mission) - ahead, mission.target.speed_mps)


def least_acceleration_mps2(mission: MissionFields, within_s: float) -> float:
    """With less no drone that begins behind can be beyond the goal line ``within_s``: it flies there from a standstill.

    Infinite where it would have to fly faster than drones can.
    """
    way = max(0.0, _goal_m(mission, certain=True) - _rear_m(mission) - mission.start.radius_m)
    speed = mission.limits.speed_mps
    if way <= speed * within_s / 2:
        return 2 * way / within_s**2
    return speed**2 / (2 * (speed * within_s - way)) if way < speed * within_s else math.inf


def _rear_m(mission: MissionFields) -> float:
    """x of the rear slot [m], when those who are killed have left theirs."""
    offsets = sorted(mission.layout.offsets[:, 0].tolist())
    killed = {
        who for fault in mission.faults if fault.kind == "kill" for who in (*fault.agents, *fault.slots)
    }
    return float(offsets[min(len(killed), len(offsets) - 1)])


def limit_ticks(mission: MissionFields) -> int:
    """Ticks until a whole flight counts as failed."""
    return ticks_of(usual_limit_s(mission) if mission.time_limit_s is None else mission.time_limit_s)


def usual_limit_s(mission: MissionFields) -> float:
    """The usual time limit, or longer where the target takes the rear slot beyond the goal line later."""
    rear = float(mission.layout.offsets[:, 0].min())
    least = _when(_goal_m(mission, certain=False) - rear, mission.target.speed_mps)
    return max(USUAL_LIMIT_S, math.ceil(_SLACK * least)) if least < LONGEST_S else LONGEST_S


def _when(way_m: float, speed_mps: float) -> float:
    if way_m < 0:
        return 0.0
    return way_m / speed_mps if speed_mps > 0 else math.inf


def _goal_m(mission: MissionFields, certain: bool) -> float:
    """Where the goal line lies, before the map is drawn: at least there if ``certain``, else at most."""
    spec, ends = mission.obstacles, [mission.goal_x_m]
    if spec.discs is not None:
        ends += [x + radius for x, _, radius in spec.discs]
    elif certain and spec.count[0] > 0:
        ends.append(spec.x_m[0] + spec.radius_m[0])
    elif not certain and spec.count[1] > 0:
        ends.append(spec.x_m[1] + spec.radius_m[1])
    return max(ends)
