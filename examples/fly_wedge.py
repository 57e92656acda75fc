"""A mission of one's own, flown from Python: what came of it, and where the drones were when it was decided."""

from pathlib import Path

import rsc_swarm as rs

HERE = Path(__file__).parent


def main() -> None:
    mission = rs.mission(HERE / "wedge.yaml", map_seed=3)
    flight = rs.simulate(mission)
    report, path = flight.report, flight.trajectory
    print(f"success: {report.success}, {report.detail}")
    if report.tau_s is None:
        return
    row = round(report.tau_s / path.tick_s)
    for agent in range(mission.agents):
        if path.flying[row, agent]:
            x, y = path.positions[row, agent]
            print(f"agent {agent} in slot {path.slots[row, agent]} at x = {x:.1f} m, y = {y:.1f} m")


if __name__ == "__main__":
    main()
