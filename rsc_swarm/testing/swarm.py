"""What a test does with missions: fly them, and ask whether all was kept that must be."""

import shlex
from pathlib import Path

from protocols.mission.document import Mission
from rsc_swarm.api import simulate, write_report
from rsc_swarm.campaign.flying import Failure, fly_all
from rsc_swarm.campaign.judging import Broken, judge
from rsc_swarm.campaign.kept import keep, replay_command
from rsc_swarm.given import a_mission
from rsc_swarm.study.workers import Flight


class Broke(AssertionError):
    """A flight did not keep what it must: what broke, with which faults, and the command that flies it again.

    path: the mission, kept as a file; `report` writes the story of the flight beside it.
    """

    def __init__(self, failure: Failure, path: Path) -> None:
        self.failure, self.path = failure, path
        mission = failure.mission
        faults = [
            f"  {fault.at_s:6.2f} s  {fault.kind}  " + " ".join(
                f"{name} {value}" for name, value in fault.model_dump(exclude_defaults=True, exclude={"at_s", "kind"}).items()
            )
            for fault in mission.faults
        ]  # fmt: skip
        lines = [
            f"{failure.broken.name}: {failure.broken.detail}",
            f"{mission.agents} drones, policy {mission.policy}, map {mission.map_seed}, seed {mission.seed}",
            *(faults or ["  nothing went wrong"]),
            f"Fly it again:  rsc-swarm simulate --mission {shlex.quote(str(path))}",
            f"In processes:  {replay_command(path)}",
        ]
        super().__init__("\n".join(lines))

    def report(self) -> Path:
        """Fly it again, and write what happened, when and why as one HTML file.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        page = self.path.with_suffix(".html")
        write_report(simulate(self.failure.mission), page)
        return page


class Swarm:
    """Flies missions for tests; those that break something are kept in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def fly(self, mission: Mission) -> Flight:
        """Fly one in this process: how it ended (``outcome``), and what was watched of the slots (``watched``).

        Raises:
            MissionError, PolicyError: it cannot be flown.
        """
        return fly_all([a_mission(mission)], both=True)[0]

    def survives(self, mission: Mission) -> None:
        """Fly it, and ask for safety and liveness (docs/campaigns.md).

        Raises:
            Broke: it did not keep something; what nobody could prevent is not asked for.
        """
        flight = self.fly(mission)
        broken = judge(mission, flight)
        if isinstance(broken, Broken):
            failure = Failure(broken, mission, flight.outcome.digest, 0, len(mission.faults))
            raise Broke(failure, keep(failure, self.folder))
