"""The missions that come with the project, and how a mission is found by its name."""

from difflib import get_close_matches
from pathlib import Path

SHIPPED = Path(__file__).parent
_LONGEST = 100  # of a name that is told


def shipped_missions() -> list[str]:
    """Names of the missions that come with the project."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def mission_file(name: str) -> Path:
    """Where the mission called ``name`` is: a file, or one of the shipped missions.

    Raises:
        protocols.mission.document.MissionError: neither.
    """
    from protocols.mission.document import MissionError

    file, shipped = Path(name), shipped_missions()
    try:
        if file.is_file():
            return file
        if name in shipped:
            return SHIPPED / f"{name}.yaml"
        if file.is_dir():
            raise MissionError(f"{name}: is a folder; give a mission file, such as mission.yaml in it")
    except OSError as error:
        short = name if len(name) <= _LONGEST else f"{name[:_LONGEST]}..."
        raise MissionError(f"{short}: cannot be looked at ({error.strerror})") from None
    like = get_close_matches(name, shipped, 1)
    meant = f"is {like[0]} meant? " if like else ""
    raise MissionError(f"{name}: no such file; {meant}shipped missions are {', '.join(shipped)}")
