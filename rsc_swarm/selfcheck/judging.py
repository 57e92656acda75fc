"""How a flight went for all drones but one: the referee looks at the recorded paths again, without that one."""

import numpy as np

from protocols.dynamics import target_x
from protocols.mission.document import Mission
from world import plant, referee
from world.order import any_order
from world.outcome import Judgement, Outcome
from world.outlets.trajectory import Trajectory


def without(mission: Mission, flown: Trajectory, outsider: int) -> Outcome:
    """What came of the flight of the others: whatever ``outsider`` did, and one slot of any kind may be empty."""
    agents, discs = mission.agents, flown.obstacles
    formation, ground = (
        mission.layout,
        plant.Ground(np.array([flown.goal_x]), np.array([len(discs)]), discs[None]),
    )
    standard = referee.Standard(
        formation.offsets, formation.parent, formation.spacing, mission.edge_tolerance, mission.limits.collision_m,
        closed=False,
    )  # fmt: skip
    found = referee.empty_findings(1, agents)
    judgement, nothing, active = Judgement(mission), np.zeros((1, agents, 2)), np.ones(1, np.bool_)
    flying = flown.flying & (np.arange(agents) != outsider)
    tick = 0
    while not judgement.over and tick + 1 < len(flown.positions):
        tick += 1
        position, claim = flown.positions[tick][None].copy(), flown.slots[tick][None].copy()
        bodies = plant.Bodies(
            flying[tick][None], position, nothing, nothing, np.ones((1, agents)), any_order(1, agents)
        )
        target = np.array([target_x(tick, mission.target.speed_mps)])
        referee.judge(active, bodies, claim, ground, target, standard, found)
        judgement.settle(tick, referee.Verdict._make(found.verdict[0].tolist()), position[0])
    return judgement.outcome(tick, "interrupted", flying[tick])
