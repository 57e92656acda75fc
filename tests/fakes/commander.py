"""Which setpoint counts on a Crazyflie, the radio's or the high-level commander's (commander.c, planner.c of the firmware)."""

from dataclasses import dataclass

from tests.fakes.motion import Goal, Vector


@dataclass(frozen=True)
class Plan:
    """A way of the high-level commander from rest to rest, begun at ``begun`` [s]."""

    start: Vector
    goal: Vector
    yaw: float
    begun: float
    duration: float
    is_landing: bool

    def at(self, now: float) -> Goal:
        """A polynomial of 7th order, without jerk at its ends."""
        t = min(1.0, max(0.0, (now - self.begun) / max(self.duration, 1e-3)))
        done = 35 * t**4 - 84 * t**5 + 70 * t**6 - 20 * t**7
        speed = (140 * t**3 - 420 * t**4 + 420 * t**5 - 140 * t**6) / max(self.duration, 1e-3)
        way = [to - at for at, to in zip(self.start, self.goal, strict=True)]
        p = [at + done * part for at, part in zip(self.start, way, strict=True)]
        return Goal((p[0], p[1], p[2]), (speed * way[0], speed * way[1], speed * way[2]), yaw=self.yaw)

    def is_over(self, now: float) -> bool:
        return now - self.begun >= self.duration


class Commander:
    """Which setpoint counts."""

    HIGH_LEVEL, RADIO = 1, 2

    def __init__(self) -> None:
        self.goal: Goal | None = None  # none: motors off
        self.stamp, self.priority = 0.0, 0
        self.plan: Plan | None = None

    def set(self, goal: Goal | None, priority: int, now: float) -> None:
        if priority >= self.priority:
            self.goal, self.priority, self.stamp = goal, priority, now
            if priority > self.HIGH_LEVEL:
                self.plan = None

    def relax(self) -> None:
        self.priority = self.HIGH_LEVEL

    def follow_plan(self, now: float) -> None:
        goal = self.plan.at(now) if self.plan else None
        if self.plan and self.plan.is_landing and self.plan.is_over(now):
            self.plan = None
        self.set(goal, self.HIGH_LEVEL, now)
