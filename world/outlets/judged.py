"""The referee's findings on every row of a recording, as it had them in flight."""

import numpy as np

from protocols.kernels import by_reference
from protocols.mission.document import Mission
from world.order import any_order
from world.outlets.trajectory import Trajectory
from world.plant import Bodies, Ground
from world.referee import Findings, Standard, empty_findings, judge


def findings_of(path: Trajectory, mission: Mission) -> Findings:
    """What the referee finds in each of the T rows of ``path``: row t is world t of `world.referee.Findings`.

    A flight itself judges rows 1, 2, ...: what is so after each tick.
    """
    rows, agents = path.flying.shape
    still = np.zeros((rows, agents, 2))
    bodies = Bodies(
        path.flying.copy(),
        path.positions.copy(),
        still,
        still,
        np.ones((rows, agents)),
        any_order(rows, agents),
    )
    discs = np.tile(path.obstacles, (rows, 1, 1)) if len(path.obstacles) else np.zeros((rows, 1, 3))
    ground = Ground(np.full(rows, path.goal_x), np.full(rows, len(path.obstacles), np.int64), discs)
    layout = mission.layout
    standard = Standard(
        layout.offsets, layout.parent, layout.spacing, mission.edge_tolerance,
        mission.limits.collision_m, closed=True,
    )  # fmt: skip
    findings = empty_findings(rows, agents)
    target = mission.target.speed_mps * path.tick_s * np.arange(rows, dtype=np.float64)
    # By reference, as in flight: so it is compiled once for both.
    judge(
        np.ones(rows, np.bool_), by_reference(bodies), path.slots.copy(), by_reference(ground), target,
        by_reference(standard), by_reference(findings),
    )  # fmt: skip
    return findings
