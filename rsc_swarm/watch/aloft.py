"""The live page of a fleet on the air: where its operator hears the drones to be, once they go. It looks on, no more."""

import time
from dataclasses import replace

from rsc_swarm.air.judged import path_of
from rsc_swarm.air.station import Station
from rsc_swarm.air.tower import Attend
from rsc_swarm.watch.replay import recorded_picture
from rsc_swarm.watch.window import EVERY_S, Window
from world.outlets.judged import findings_of
from world.outlets.picture import scene_of


class Aloft:
    """Shows what an operator's station knows, before somebody else attends to it (rsc_swarm.air.tower.Attend)."""

    def __init__(self, window: Window, attend: Attend) -> None:
        self._window, self._attend = window, attend
        self._shown, self._shown_rows = float("-inf"), 0

    def __call__(self, station: Station, utc_us: int, now: float) -> bool:
        self.show(station)
        return self._attend(station, utc_us, now)

    def show(self, station: Station) -> None:
        """Show the fleet if that is due."""
        log, now = station.log, time.monotonic()
        if log.rows <= self._shown_rows or now - self._shown < EVERY_S:
            return
        path, mission = path_of(station.plan, log), station.plan.mission
        if not self._shown_rows:
            scene = scene_of(mission, path.obstacles, path.goal_x)
            self._window.say({"kind": "scene", "scene": scene | {"ticks": station.plan.ticks}})
        last = slice(log.rows - 1, log.rows)
        moment = replace(
            path, positions=path.positions[last], velocities=path.velocities[last], slots=path.slots[last],
            flying=path.flying[last],
        )  # fmt: skip
        picture = recorded_picture(moment, findings_of(moment, mission), 0)
        self._window.show(replace(picture, tick=log.rows - 1).packed())
        self._shown, self._shown_rows = now, log.rows
