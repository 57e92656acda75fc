"""From sensors and heard frames to what a drone knows: neighbours, relative positions, obstacles, who is alive."""

import numpy as np
from numpy.typing import NDArray

from agent.heard import find_heard, keep_clear, note_acceleration, take_word
from agent.memory import Memory, put_neighbour, within_of
from agent.relay import fixed_point, mean_over_neighbours
from agent.tick_arrays import Rules, Work
from protocols.dynamics import TICK_S, vector
from protocols.kernels import inlined_kernel
from protocols.relative import Heard, Nearby, RadioRules, Ways, chain_displacements
from protocols.wire.frames import (
    AGE_NEVER,
    AGE_UNIT_TICKS,
    AGE_WINDOW,
    MAX_KNOWN,
    OBSERVATION_SIZE,
    RELAYING,
    VERSION,
    Frames,
)
from protocols.wire.sensed import Sensed

_SLACK_M, _SLACK_MPS = 0.5, 0.1  # of what a drone says of its own motion
_SAME_DISC_M = 0.05  # sightings this alike in centre and radius are of one obstacle; discs may overlap


@inlined_kernel
def _can_be(
    now: NDArray[np.float32], before: NDArray[np.float32], ticks: int, memory_ticks: int, speed_mps: float
) -> bool:
    """Whether a drone that said it moved like ``before`` (4,), p [m] and v [m/s], and is still believed, can move like ``now`` so
    many ticks later.
    """
    x, y, vx, vy = np.float64(now[0]), np.float64(now[1]), np.float64(now[2]), np.float64(now[3])
    fastest = speed_mps + _SLACK_MPS
    if vx * vx + vy * vy > fastest * fastest:
        return False
    farthest = speed_mps * ticks * TICK_S + _SLACK_M
    dx, dy = x - before[0], y - before[1]
    return ticks > memory_ticks or dx * dx + dy * dy <= farthest * farthest


@inlined_kernel
def hear_frame(memory: Memory, row: int, frames: Frames, index: int, radio: RadioRules) -> None:
    """Keep what frame ``index`` says if it is newer than the sender's last and a drone can have moved like that since; merge whom
    its sender has heard lately.
    """
    sender, tick = np.int64(frames.sender[index]), np.int64(frames.tick[index])
    last_seen, agents = memory.last_seen[row], memory.last_seen.shape[1]
    last_seen[sender] = max(last_seen[sender], tick)
    other = int(frames.age_from[index])
    for offset in range(min(AGE_WINDOW, agents)):
        age = np.int64(frames.ages[index, offset])
        if age != AGE_NEVER:
            last_seen[other] = max(last_seen[other], tick - age * AGE_UNIT_TICKS)
        other = other + 1 if other + 1 < agents else 0
    later = tick - memory.heard_tick[row, sender]
    if later <= 0:
        return
    motion, before = frames.motion[index], memory.heard_motion[row, sender]
    if not _can_be(motion, before, later, radio.memory_ticks, radio.speed_mps):
        return
    memory.heard_tick[row, sender] = tick
    note_acceleration(motion, before, later, radio.memory_ticks, memory.heard_acceleration[row, sender])
    for place in range(4):
        before[place] = motion[place]
    for place in range(OBSERVATION_SIZE):
        memory.heard_observation[row, sender, place] = frames.observation[index, place]
    for passed_on in range(memory.heard_relayed.shape[2]):
        told = frames.version[index] == RELAYING
        for place in range(OBSERVATION_SIZE):
            said = frames.relayed[index, passed_on, place] if told else np.int16(0)
            memory.heard_relayed[row, sender, passed_on, place] = said
    count = np.int64(frames.known_count[index])
    memory.heard_one_hop[row, sender] = frames.one_hop[index]
    memory.heard_count[row, sender] = count
    known, displacement = memory.heard_known[row, sender], memory.heard_displacement[row, sender]
    for entry in range(count):
        known[entry] = frames.known[index, entry]
        displacement[entry, 0] = frames.displacement[index, entry, 0]
        displacement[entry, 1] = frames.displacement[index, entry, 1]


@inlined_kernel
def find_sensed(memory: Memory, row: int, sensed: Sensed) -> None:
    """Neighbours from the drone's own sensors."""
    count = sensed.near_count[row]
    for index in range(count):
        near = sensed.near[row, index]
        rel, vel = (near["x"], near["y"]), (near["vx"], near["vy"])
        put_neighbour(memory, row, index, near["number"], rel, vel)
    memory.near_count[row] = count


@inlined_kernel
def recall_obstacles(memory: Memory, row: int, sensed: Sensed, remember: bool) -> None:
    """Bring the list of obstacles up to date with what is sensed now; without memory, drop what is out of sight."""
    px, py = vector(sensed.position, row)
    known = memory.disc_count[row]
    seen_now = 0  # bit i: obstacle i
    for index in range(sensed.obstacle_count[row]):
        seen = sensed.obstacles[row, index]
        x, y, radius = px + seen["x"], py + seen["y"], seen["radius"]
        match = -1
        for disc in range(known):
            if (
                abs(memory.disc[row, disc, 0] - x) < _SAME_DISC_M
                and abs(memory.disc[row, disc, 1] - y) < _SAME_DISC_M
                and abs(memory.disc[row, disc, 2] - radius) < _SAME_DISC_M
            ):
                match = disc
        if match < 0 and known < memory.disc.shape[1]:
            match = known
            memory.disc_side[row, match] = 0
            known += 1
        if match >= 0:
            seen_now |= 1 << match
            memory.disc[row, match, 0], memory.disc[row, match, 1] = x, y
            memory.disc[row, match, 2] = radius
    kept = 0
    for disc in range(known):
        if remember or (seen_now >> disc) & 1:
            if kept < disc:
                for place in range(3):
                    memory.disc[row, kept, place] = memory.disc[row, disc, place]
                memory.disc_side[row, kept] = memory.disc_side[row, disc]
            memory.obstacle_rel[row, kept, 0] = memory.disc[row, kept, 0] - px
            memory.obstacle_rel[row, kept, 1] = memory.disc[row, kept, 1] - py
            memory.obstacle_radius[row, kept] = memory.disc[row, kept, 2]
            kept += 1
    memory.disc_count[row] = kept


@inlined_kernel
def perceive_row(
    tick: int, row: int, rules: Rules, work: Work, sensed: Sensed, frames: Frames, memory: Memory
) -> None:
    """One tick of perception for one row."""
    me = work.me[row]
    memory.last_seen[row, me] = tick
    for place in range(work.inbox_start[row], work.inbox_start[row + 1]):
        hear_frame(memory, row, frames, work.inbox[place], rules.radio)
    if rules.by_sensor:
        find_sensed(memory, row, sensed)
    else:
        for place in range(work.inbox_start[row], work.inbox_start[row + 1]):
            index = work.inbox[place]
            sender, told = int(np.int64(frames.sender[index])), int(np.int64(frames.tick[index]))
            take_word(memory, row, me, sender, told, rules)
        find_heard(memory, row, me, tick, sensed, rules.radio, rules.limits.max_acceleration)
    recall_obstacles(memory, row, sensed, rules.remember_obstacles)
    near = Nearby(memory.near_count[row], memory.near_id[row], memory.near_rel[row])
    heard = Heard(
        memory.heard_tick[row], memory.heard_one_hop[row], memory.heard_count[row], memory.heard_known[row],
        memory.heard_displacement[row],
    )  # fmt: skip
    ways = Ways(memory.hops[row], memory.rel[row], memory.freshest[row], within_of(memory, row))
    chain_displacements(me, tick, rules.radio, near, heard, ways)
    mean_over_neighbours(tick, row, rules.radio, memory, work.means[row])
    if not rules.by_sensor:
        keep_clear(memory, row, me, tick, sensed, rules)


@inlined_kernel
def compose_row(
    tick: int, row: int, out: int, rules: Rules, work: Work, sensed: Sensed, frames: Frames, memory: Memory
) -> None:
    """Write what one row broadcasts into frame ``out``, but for what is said of slots."""
    me, observation, max_hops = work.me[row], work.observation, rules.radio.max_hops
    turn = tick // rules.frame_every  # counts a drone's frames, to rotate the ages
    agents = memory.heard_tick.shape[1]
    frames.tick[out] = tick
    frames.sender[out] = me
    for axis in range(2):
        frames.motion[out, axis] = sensed.position[row, axis]
        frames.motion[out, 2 + axis] = sensed.velocity[row, axis]
    for index in range(observation.shape[1]):
        frames.observation[out, index] = fixed_point(observation[row, index])
    rounds = work.means.shape[1]
    frames.version[out] = RELAYING if rounds > 1 else VERSION
    for passed_on in range(min(rounds - 1, frames.relayed.shape[1])):
        for index in range(observation.shape[1]):
            frames.relayed[out, passed_on, index] = fixed_point(work.means[row, passed_on, index])
    within = within_of(memory, row)
    told = min(within.up_to[min(2, max_hops - 1)], MAX_KNOWN)
    for index in range(told):
        other = within.number[index]
        frames.known[out, index] = other
        frames.displacement[out, index, 0] = memory.rel[row, other, 0]
        frames.displacement[out, index, 1] = memory.rel[row, other, 1]
    frames.one_hop[out] = min(within.up_to[1], told)
    frames.known_count[out] = told
    begin = (turn * AGE_WINDOW) % agents
    frames.age_from[out] = begin
    for offset in range(AGE_WINDOW):
        # Rounded up: an age that shrank in transit would keep a dead drone alive for ever.
        age = (tick - memory.last_seen[row, (begin + offset) % agents] + AGE_UNIT_TICKS - 1) // AGE_UNIT_TICKS
        frames.ages[out, offset] = min(age, AGE_NEVER)
