"""Many episodes at once: E worlds of N drones in compiled loops, for training and for the centralized expert.

Same rules as the drones and the world, called in one loop (rsc_swarm.batch.kernel); a perfect radio and no faults. A
flight of the analytic controller without swaps is, bit for bit, the one that `Simulation` flies.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agent.control.follow import following_of
from agent.memory import empty_memory, forget
from agent.observation import WIDE_SIZE
from agent.relay import COUNTED
from agent.rules import rules_of, shape_of
from agent.tick_arrays import TickArrays, empty_views, empty_work
from protocols.dynamics import TICK_S, ticks_of
from protocols.kernels import by_reference
from protocols.mission.document import Mission, MissionError
from protocols.wire.frames import OBSERVATION_SIZE, empty_frames
from protocols.wire.sensed import MAX_NEAR, MAX_OBSTACLES, empty_sensed
from rsc_swarm.batch import kernel as kernels
from rsc_swarm.batch import stage as stages
from rsc_swarm.batch.stage import ANALYTIC, EXPERT, FLYING, PAST, PLAN
from world import field, referee
from world.order import any_order
from world.outcome import Outcome

NEIGHBOURS = COUNTED  # noted per drone and tick
_FAILURES = {stages.COLLIDED: "collision", stages.LATE: "late"}


def check_flyable(mission: Mission) -> None:
    """Refuse what the batch leaves out.

    Raises:
        MissionError: faults, a radio that is not perfect, or an option that needs frames.
    """
    radio = mission.radio
    for wrong, what in (
        (mission.faults, "faults: the batch simulation has none"),
        (
            radio.loss
            or radio.burst.loss
            or radio.delay_ms
            or radio.jitter_ms
            or radio.duplicate
            or radio.reorder,
            "radio: the batch simulation's is perfect",
        ),
        (mission.frame_every > 1, "radio.frame_rate_hz: the batch simulation has 100"),
        (
            hears(mission) and radio.range_m != mission.sensing.range_m,
            "radio.range_m: where frames are heard in the batch simulation, that is as far as sensors see",
        ),
        (mission.sensing.neighbours == "heard", "sensing.neighbours: the batch simulation knows only sensed"),
        (mission.hold_s, "hold_s: the batch simulation ends at success"),
    ):
        if wrong:
            raise MissionError(f"{what}; fly this with rsc-swarm simulate")


def hears(mission: Mission) -> bool:
    """Whether drones must know who is out of sight: to aim by the leader, or to swap only where all stay connected."""
    return mission.aim == "chain" or (mission.swap.connected and mission.swap.rule != "off")


class Batch:
    """E worlds of N drones. ``stage`` holds all arrays, filled in place (rsc_swarm.batch.stage.Stage)."""

    def __init__(self, missions: Sequence[Mission], ends: bool = True, papers: bool = False) -> None:
        """Begin one episode per mission; they must agree in all but seeds and obstacles.

        Args:
            ends: an episode ends at the paper's success, a collision, or the time limit. Else it goes on until somebody sets its
                ``stage.result``.
            papers: the expert is the paper's (agent.control.apf), not ours.

        Raises:
            MissionError: as `check_flyable`. world.field.FieldError: no room to start.
        """
        mission = self.mission = missions[0]
        check_flyable(mission)
        worlds, agents = self.worlds, self.agents = len(missions), mission.agents
        rows, both = worlds * agents, (worlds, agents)
        listening = hears(mission)
        self.stage = stages.Stage(
            pilot=np.full(worlds, EXPERT, np.int8),
            ticks=np.zeros(worlds, np.int64),
            result=np.zeros(worlds, np.int8),
            flying=np.ones(both, np.bool_),
            position=np.zeros((*both, 2)),
            velocity=np.zeros((*both, 2)),
            command=np.zeros((*both, 2)),
            ability=np.ones(both),
            by_x=any_order(worlds, agents),
            claim=np.zeros(both, np.int16),
            obstacle_count=np.zeros(worlds, np.int64),
            obstacles=np.zeros((worlds, MAX_OBSTACLES, 3)),
            goal_x=np.zeros(worlds),
            findings=referee.empty_findings(worlds, agents),
            closest=np.zeros(worlds),
            formed=np.zeros(worlds, np.int64),
            rested=np.zeros(both, np.int64),
            swaps=np.zeros(worlds, np.int64),
            observation=np.zeros((PAST, *both, OBSERVATION_SIZE), np.float32),
            near=np.zeros((PAST, *both, NEIGHBOURS), np.int16),
            target=np.zeros((*both, 2), np.float32),
            extra=np.zeros((*both, WIDE_SIZE), np.float32),
            start=np.zeros((*both, 4)),
            displacement=np.zeros((*both, 1, 2), np.float32),
            acceleration=np.zeros((*both, 1, 2), np.float32),
        )
        self._laid_out = by_reference(self.stage)
        self._field = by_reference(
            stages.Field(
                a_max=mission.limits.acceleration_mps2,
                v_max=mission.limits.speed_mps,
                spacing_m=mission.layout.spacing,
                edge_tolerance=mission.edge_tolerance,
                collision_m=mission.limits.collision_m,
                last_tick=mission.ticks,
                cooldown_ticks=ticks_of(mission.swap.cooldown_s),
                ends=ends,
                hears=listening,
                both_rest=mission.swap.protocol == "agreed",
                papers=papers,
                following=following_of(mission),
            )
        )
        self._scratch = by_reference(
            stages.Scratch(
                np.zeros(agents, np.int64),
                np.zeros((MAX_OBSTACLES, 2)),
                np.zeros(MAX_OBSTACLES),
                np.zeros(MAX_OBSTACLES, np.int8),
            )
        )
        self._parts = TickArrays(
            rules_of(mission),
            shape_of(mission),
            empty_views(rows, agents),
            empty_work(np.tile(np.arange(agents), worlds))._replace(
                inbox=np.zeros(rows * MAX_NEAR, np.int64)
            ),
            empty_sensed(rows),
            empty_frames(2 * rows if listening else 1),
            empty_memory(rows, agents if listening else 1),
        )
        self._arrays = by_reference(self._parts)
        for world, one in enumerate(missions):
            self.restart(world, one)

    def restart(self, world: int, mission: Mission) -> None:
        """Begin a fresh episode in ``world``.

        Raises:
            world.field.FieldError: no room to start.
        """
        stage, rows = self.stage, slice(world * self.agents, (world + 1) * self.agents)
        views, memory = self._parts.views, self._parts.memory
        discs = field.draw_obstacles(mission)
        stage.position[world], stage.claim[world] = (
            field.draw_start(mission, discs),
            field.draw_slots(mission),
        )
        stage.velocity[world] = stage.command[world] = stage.rested[world] = 0
        stage.obstacle_count[world] = len(discs)
        stage.obstacles[world, : len(discs)] = discs
        stage.goal_x[world] = field.goal_x(mission, discs)
        stage.ticks[world], stage.result[world], stage.swaps[world] = 0, FLYING, 0
        stage.closest[world], stage.formed[world] = np.inf, -1
        views.slot_of[rows] = stage.claim[world]
        views.occupant[rows] = np.argsort(stage.claim[world])
        for row in range(rows.start, rows.stop):
            forget(memory, row, 0)
        kernels.begin(world, self._laid_out, self._field, self._arrays)

    def label(self, horizon: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What the expert would do in the next ``horizon`` ticks, flying all drones from here; nothing changes.

        Returns:
            displacement p(t + h + 1) - p(t) - (h + 1) dt v(t) [m] and velocity change v(t + h + 1) - v(t) [m/s], (E, N, H, 2)
            each; zero in worlds whose episode has ended.
        """
        shape = (self.worlds, self.agents, horizon, 2)
        displacement, velocity_change = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        kernels.label(self._laid_out, self._field, self._arrays, self._scratch, displacement, velocity_change)
        return displacement, velocity_change

    def fly(
        self,
        ticks: int,
        acceleration: NDArray[np.float32] | None = None,
        displacement: NDArray[np.float32] | None = None,
        by_expert: NDArray[np.bool_] | None = None,
        analytic: bool = False,
    ) -> None:
        """Fly every world whose episode goes on by ``ticks`` ticks, or to its end.

        Args:
            acceleration, displacement: (E, N, P, 2) plans from here, P >= ticks, as in a model file; without them the expert
                flies, or with ``analytic`` the analytic controller, each drone for itself.
            by_expert: (E,) worlds in which the expert flies although there are plans.
        """
        stage, laid_out = self.stage, self._laid_out
        stage.pilot[:] = ANALYTIC if analytic else EXPERT
        if acceleration is not None and displacement is not None:
            stage.pilot[:] = PLAN if by_expert is None else np.where(by_expert, EXPERT, PLAN)
            laid_out = by_reference(
                stage._replace(
                    acceleration=np.ascontiguousarray(acceleration, np.float32),
                    displacement=np.ascontiguousarray(displacement, np.float32),
                )
            )
        kernels.fly(ticks, laid_out, self._field, self._arrays, self._scratch)

    def outcome(self, world: int) -> Outcome:
        """How the episode of ``world`` ended, as a flight's report has it."""
        stage, verdict = self.stage, referee.Verdict._make(self.stage.findings.verdict[world].tolist())
        success, ticks, formed = (
            stage.result[world] == stages.SUCCEEDED,
            int(stage.ticks[world]),
            int(stage.formed[world]),
        )
        return Outcome(
            success=bool(success),
            failure=None if success else _FAILURES[int(stage.result[world])],
            ticks=ticks,
            tau_s=round(ticks * TICK_S, 2) if success else None,
            formed_s=round(formed * TICK_S, 2) if formed >= 0 else None,
            max_edge_error=verdict.edge_error,
            max_slot_error_m=verdict.slot_error_m,
            min_distance_m=float(stage.closest[world]),
            closest="",
            held_after_success=None,
            overlap_s=0.0,
            lost_agents=(),
            digest="",
        )
