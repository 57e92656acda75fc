"""The missions that come with the project, and how a mission is found by its name."""

from pathlib import Path

SHIPPED = Path(__file__).parent


def shipped_missions() -> list[str]:
    """Names of the missions that come with the project."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def mission_file(name: str) -> Path:
    """Where the mission called ``name`` is: a file, or one of the shipped missions.

    Raises:
        protocols.mission.document.MissionError: neither.
    """
    file = Path(name)
    if file.is_file():
        return file
    if name in shipped_missions():
        return SHIPPED / f"{name}.yaml"
    from protocols.mission.document import MissionError

    raise MissionError(f"{name}: no such file; shipped missions are {', '.join(shipped_missions())}")
