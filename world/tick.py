"""The two compiled halves of a world's tick: what drones sense and hear, and what becomes of their answers."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.dynamics import TICK_S, target_x
from protocols.kernels import inlined_kernel, kernel
from protocols.wire.sensed import Sensed
from world import plant as physics
from world import referee
from world.medium import information_bound as information_bound
from world.medium import medium


class Stage(NamedTuple):
    """Everything that the rules of a tick work on, of E worlds.

    responsive, hears: (E, N) who answers; whose radio is on now. claim: (E, N) slots. target: (E,) x of the virtual target [m],
    target_mps its speed. acceleration_mps2, speed_mps: the limits of all drones. reach_m: of their sensors. sizes: (E, D, N)
    bytes of the frames sent, by tick % D. bound: of no worlds where nothing can go wrong. The rest as its class says, and as
    `medium.relay` and `medium.deliver` do.
    """

    clocks: medium.Clocks
    responsive: NDArray[np.bool_]
    hears: NDArray[np.bool_]
    claim: NDArray[np.int16]
    target: NDArray[np.float64]
    target_mps: float
    bodies: physics.Bodies
    ground: physics.Ground
    acceleration_mps2: float
    speed_mps: float
    reach_m: float
    neighbours_sensed: bool
    sensed: Sensed
    link: medium.Link
    air: medium.Air
    bad: NDArray[np.bool_]
    queue: medium.Queue
    tally: NDArray[np.int64]
    sizes: NDArray[np.int64]
    inbox_start: NDArray[np.int64]
    inbox: NDArray[np.int32]
    standard: referee.Standard
    findings: referee.Findings
    bound: information_bound.InformationBound


@kernel
def perceive(stage: Stage) -> int:
    """Let all sense and hear; return how many frames arrive."""
    active, bodies, hears = stage.clocks.active, stage.bodies, stage.hears
    physics.sense(active, bodies, stage.ground, stage.reach_m, stage.neighbours_sensed, stage.sensed)
    for world in range(hears.shape[0]):
        for agent in range(hears.shape[1]):
            hears[world, agent] = stage.responsive[world, agent] and bodies.flying[world, agent]
    start, inbox = stage.inbox_start, stage.inbox
    total = medium.deliver(
        stage.clocks.ticks, active, hears, stage.sizes, stage.queue, stage.tally, start, inbox
    )
    if stage.bound.latest.shape[0] > 0:
        information_bound.spread(stage.bound, stage.clocks.ticks, active, start, inbox)
    return total


@kernel
def advance(
    command: NDArray[np.float64], sent_bytes: NDArray[np.int64], claim: NDArray[np.int64], stage: Stage
) -> None:
    """Take the answers, relay what was said, move, go on to the next tick, and judge."""
    clocks, bodies = stage.clocks, stage.bodies
    _take_answers(command, sent_bytes, claim, stage)
    medium.relay(stage.link, clocks, stage.air, stage.bad, stage.queue, stage.tally)
    physics.move(clocks.active, bodies, stage.acceleration_mps2, stage.speed_mps, TICK_S)
    for world in range(clocks.active.shape[0]):
        if clocks.active[world]:
            clocks.ticks[world] += 1
            stage.target[world] = target_x(clocks.ticks[world], stage.target_mps)
    referee.judge(
        clocks.active, bodies, stage.claim, stage.ground, stage.target, stage.standard, stage.findings
    )


@inlined_kernel
def _take_answers(
    command: NDArray[np.float64], sent_bytes: NDArray[np.int64], claim: NDArray[np.int64], stage: Stage
) -> None:
    """Take over, from rows, what those said that are awake; the others' commands and claims stay, and they sent nothing."""
    flying, commands, sent, sizes = (
        stage.bodies.flying,
        stage.bodies.command,
        stage.air.sent_bytes,
        stage.sizes,
    )
    worlds, agents = flying.shape
    for world in range(worlds):
        bucket = stage.clocks.ticks[world] % sizes.shape[1]
        for agent in range(agents):
            row = world * agents + agent
            awake = stage.responsive[world, agent] and flying[world, agent]
            sizes[world, bucket, agent] = sent[world, agent] = sent_bytes[row] if awake else 0
            if awake:
                commands[world, agent, 0], commands[world, agent, 1] = command[row, 0], command[row, 1]
                stage.claim[world, agent] = claim[row]
