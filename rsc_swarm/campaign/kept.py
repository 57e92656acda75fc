"""Missions that broke something, kept as files: a regression suite that anybody can fly."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

from protocols.errors import SwarmError
from protocols.mission.document import Mission, parse_mission, read_mission_fields
from protocols.mission.policy_name import from_folder
from protocols.mission.reading import write_yaml
from protocols.printable import one_line
from protocols.whole_file import write_whole
from rsc_swarm.campaign.flying import Failure, fly_all
from rsc_swarm.campaign.judging import Broken, judge
from rsc_swarm.flight.provenance import commit
from rsc_swarm.study.finished import JOURNAL

_BROKE, _DIGEST, _COMMIT = "broke", "digest", "commit"


class KeptError(SwarmError, ValueError):
    """A folder or file of kept missions that cannot be used; one line says why."""


@dataclass(frozen=True)
class Kept:
    """A kept mission: what it broke, with which digest, by the code of which commit. All but the mission may be unknown."""

    path: Path
    mission: Mission
    broke: str | None
    digest: str | None
    commit: str | None

    def compared(self, digest: str) -> str:
        """Whether a flight with this digest is the one that was kept, as a sentence."""
        if digest == self.digest:
            return f"This is the flight that was kept, bit for bit. It broke: {self.broke}."
        return f"This is not the flight that was kept (digest {self.digest}, commit {self.commit}). That broke: {self.broke}."


@dataclass(frozen=True)
class Flown:
    """A kept mission, flown again: what it breaks now, and the digest of the flight."""

    kept: Kept
    broken: Broken | None
    digest: str

    def __str__(self) -> str:
        name, before = one_line(str(self.kept.path)), self.kept.broke
        if not self.broken:
            return f"{name}: keeps all" + (f" (it broke: {before})" if before else "")
        as_kept = ", as kept bit for bit" if self.digest == self.kept.digest else ""
        return f"{name}: {self.broken.name}{as_kept}: {self.broken.detail}"


def replay_command(path: Path) -> str:
    """What to type to fly the mission kept as this file again, in processes."""
    return shlex.join(["rsc-swarm", "campaign", "--replay", str(path)])


def keep(failure: Failure, folder: Path) -> Path:
    """Write the mission of ``failure`` into ``folder``, below a name for what it broke; where that is.

    Raises:
        KeptError: the folder cannot be made. protocols.whole_file.WriteError: the file cannot be written.
    """
    mission = failure.mission
    group = folder / re.sub(r"\W+", "-", failure.broken.name).strip("-")
    try:
        group.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise KeptError(f"--out {folder}: cannot be made ({error.strerror})") from None
    path = group / f"{mission.map_seed}-{mission.seed}-{failure.digest[:8]}.yaml"  # seeds may be drawn twice
    anywhere = mission.model_copy(update={"policy": from_folder(mission.policy, Path.cwd())})
    head = "".join(
        f"# {name}: {value}\n"
        for name, value in (
            (_BROKE, failure.broken.name),
            ("detail", failure.broken.detail),
            (_DIGEST, failure.digest),
            (_COMMIT, commit() or "unknown"),
        )
    )
    write_whole(path, head + write_yaml(anywhere.model_dump(mode="json", exclude_defaults=True)))
    return path


def read_kept(path: Path) -> Kept:
    """A kept mission.

    Raises:
        protocols.mission.document.MissionError: it cannot be flown.
    """
    mission = parse_mission(read_mission_fields(path), str(path))
    lines = re.findall(r"^# (\w+): (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    said = {name: one_line(text) for name, text in lines}
    return Kept(path, mission, said.get(_BROKE), said.get(_DIGEST), said.get(_COMMIT))


def all_kept(folder: Path) -> list[Kept]:
    """Every kept mission in the folder and those in it; none in that of a campaign in which nothing broke.

    Raises:
        KeptError: it is no such folder. protocols.mission.document.MissionError: one cannot be flown.
    """
    found = sorted(folder.rglob("*.yaml"))
    if not found and not any(folder.glob(f"*{JOURNAL}")):
        raise KeptError(f"--check {folder}: no missions here; give a folder of mission files (.yaml)")
    return [read_kept(path) for path in found]


def fly_kept(kept: Kept) -> Flown:
    """Fly and judge one."""
    (flight,) = fly_all([kept.mission])
    broken = judge(kept.mission, flight)
    return Flown(kept, broken if isinstance(broken, Broken) else None, flight.outcome.digest)
