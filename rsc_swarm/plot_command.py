"""``rsc-swarm plot``: find or fly the flight, then draw it."""

import json
import tempfile
from pathlib import Path

from protocols.mission import Mission, parse_mission, read_mission_fields
from rsc_swarm.options import MissionOptions, chosen, flag, resolve
from rsc_swarm.plot import PlotError, Track, draw, load_track
from rsc_swarm.rundir import RunDir


def run(options: MissionOptions, out: Path, run_dir: Path | None) -> None:
    """Draw the flight in ``run_dir``, or one flown for the purpose.

    Raises:
        PlotError, MissionError, RunDirError: one line says what is wrong.
    """
    if out.is_dir() or not out.absolute().parent.is_dir():
        raise PlotError(f"--out {out}: give a file in a directory that exists")
    if run_dir is None:
        mission = resolve(options)
        track = _flown(mission)
    else:
        if other := [flag(name) for name in chosen(options)]:
            raise PlotError(
                f"{' '.join(other)}: the flight in --run-dir is flown already; give the one or the other"
            )
        mission, track = _recorded(RunDir(run_dir))
    draw(track, mission, out)
    print(f"{out}: {track.verdict}")


def _flown(mission: Mission) -> Track:
    from rsc_swarm.flight import fly

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.npz"
        outcome = fly(mission, trajectory=path).outcome
        return load_track(
            path, outcome.tau_s, outcome.failure, _verdict(mission, outcome.failure, outcome.tau_s)
        )


def _recorded(folder: RunDir) -> tuple[Mission, Track]:
    folder.check()
    mission = parse_mission(read_mission_fields(folder.mission), str(folder.mission))
    tau, failure = None, "interrupted"
    if folder.report.is_file():
        report = json.loads(folder.report.read_text(encoding="utf-8"))
        tau, failure = report["tau_s"], report["failure"]
    return mission, load_track(folder.trajectory, tau, failure, _verdict(mission, failure, tau))


def _verdict(mission: Mission, failure: str | None, tau_s: float | None) -> str:
    drones = "1 drone" if mission.agents == 1 else f"{mission.agents} drones"
    if failure is None:
        return f"{drones}, in formation after {tau_s:.1f} s"
    return f"{drones}: {failure.replace('-', ' ')}"
