"""The constants of the analytic controller and of the safety filter, each with its unit and meaning.

Weights are folded into the gains: the controller is the plain sum of its terms, without outer factors. Both
tables are named tuples of floats, which kernels take by value.
"""

from typing import NamedTuple


class Gains(NamedTuple):
    """What the analytic controller wants: one number per rule.

    Errors are "target minus own position" in metres; accelerations in m/s²; every distance is centre to
    centre for agents and centre to surface for obstacles.
    """

    contact_m: float = 0.5  #: m, distance that counts as a collision: limits.collision_m of the mission

    # Attraction: chain target (set by the leader), slot target (set by the virtual target), heading.
    chain_pull: float = 0.546  #: 1/s², pull towards the chain target
    chain_reach: float = 1.095  #: m, chain error beyond which the pull no longer grows
    chain_damping: float = 0.029  #: 1/s, on the velocity relative to the target's
    slot_pull: float = 2.67  #: 1/s², pull towards the slot target
    slot_reach: float = 2.09  #: m, slot error beyond which the pull no longer grows
    slot_damping: float = 1.88  #: 1/s, on the velocity relative to the target's
    look_ahead: float = 6.02  #: m along the target's motion, added to the error to make the heading

    # Agents: Morse repulsion, closest approach, braking, giving way, near-contact barrier.
    morse_strength: float = 0.245  #: m/s²
    morse_decay: float = 0.741  #: 1/m
    morse_range: float = 1.31  #: m, no repulsion and no giving way beyond
    predict_gain: float = 3.95  #: 1/s, on the closing velocity, away from the predicted miss point
    predict_radius: float = 1.18  #: m, a predicted miss distance beyond this is no conflict
    predict_time: float = 1.23  #: s, time constant with which later conflicts count less
    agent_brake: float = 1.87  #: share of the braking that would stop the closing just in time
    sidestep: float = 1.27  #: m/s², sideways, when the other is ahead
    agent_barrier: float = 1.46  #: m/s²
    agent_barrier_range: float = 1.32  #: m

    # Obstacles: repulsion, braking, barrier; then the way around.
    obstacle_repulsion: float = 2.91  #: m/s² at contact distance
    obstacle_range: float = 5.04  #: m from the surface, no push beyond
    obstacle_brake: float = 2.11  #: share of the braking that would stop the closing just in time
    obstacle_barrier: float = 0.445  #: m/s²
    obstacle_barrier_range: float = 1.3  #: m from the surface
    around: float = 11.6  #: m/s² at contact distance, along the surface of an obstacle in the way
    release: float = 0.573  #: share of the attraction into a blocking obstacle that is taken away
    cluster_gap: float = 1.36  #: m between surfaces, below which two obstacles count as one
    keep_side: float = 1.558  #: m beyond obstacle_range within which the side once chosen is remembered
    lane: float = 0.407  #: m, half width of the lane along the heading that must be free of obstacles
    side_loyalty: float = 0.715  #: m, by which the other side must be shorter to give up a remembered one


class SafetyLimits(NamedTuple):
    """What the safety filter enforces: the braking-distance barrier of each neighbour and obstacle."""

    max_acceleration: float = 10.0  #: m/s², ball
    decay: float = 4.0  #: 1/s, how fast the barrier h may shrink: dh/dt >= -decay h
    agent_brake: float = 12.0  #: m/s², braking assumed of a pair of agents together
    agent_clearance: float = 0.65  #: m, centre to centre
    agent_share: float = 0.75  #: of a pair's burden taken by each; over half, as one may be held by a wall
    obstacle_brake: float = 4.0  #: m/s², braking assumed before an obstacle; a drone at half strength has it
    obstacle_clearance: float = 0.6  #: m from the surface
    row_limit: float = 9.0  #: m/s², no single row asks for more than this


GAINS = Gains()  # found for drones that collide at 0.5 m
LIMITS = SafetyLimits()


def gains_for(collision_m: float) -> Gains:
    """The gains of drones that collide at so much [m]: every distance at which they begin to keep apart moves along with it.

    Two obstacles that a drone passes between need room on both sides. Within which distance obstacles are looked at, and how
    steeply pushes grow, does not change.
    """
    farther = collision_m - GAINS.contact_m
    return GAINS._replace(
        contact_m=collision_m,
        morse_range=GAINS.morse_range + farther,
        predict_radius=GAINS.predict_radius + farther,
        agent_barrier_range=GAINS.agent_barrier_range + farther,
        obstacle_range=GAINS.obstacle_range + farther,
        obstacle_barrier_range=GAINS.obstacle_barrier_range + farther,
        cluster_gap=GAINS.cluster_gap + 2.0 * farther,
        lane=max(GAINS.lane + farther, 0.0),
    )


def reactive_part(gains: Gains) -> Gains:
    """What is left of them for the moment: slot, obstacles, agents."""
    return gains._replace(chain_pull=0.0, chain_damping=0.0)


def limits_for(max_acceleration: float, collision_m: float) -> SafetyLimits:
    """The limits of drones that accelerate by at most so much [m/s²] and collide at so much [m]: all that is counted on changes
    with it."""
    share, farther = max_acceleration / LIMITS.max_acceleration, collision_m - GAINS.contact_m
    return LIMITS._replace(
        agent_clearance=LIMITS.agent_clearance + farther,
        obstacle_clearance=LIMITS.obstacle_clearance + farther,
        max_acceleration=max_acceleration,
        agent_brake=share * LIMITS.agent_brake,
        obstacle_brake=share * LIMITS.obstacle_brake,
        row_limit=share * LIMITS.row_limit,
    )
