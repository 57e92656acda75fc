"""From a fleet file to the plan of a flight: the mission that it names is found and laid in its room."""

from pathlib import Path

from protocols.fleet.document import FleetError, read_fleet
from protocols.fleet.plan import Plan, make_plan
from protocols.mission.document import Mission, MissionError, parse_mission, read_mission_fields
from protocols.wire.keys import login_file
from rsc_swarm.air.bodies import check_bodies
from rsc_swarm.missions import SHIPPED, shipped_missions
from rsc_swarm.options import MissionOptions, named, resolve

_OF_THE_WORLD = ("radio", "faults", "seed", "success", "hold_s")


def read_plan(path: Path) -> Plan:
    """The plan in the fleet file at ``path``; a mission's file is looked for beside it.

    Raises:
        FleetError: it cannot be read or flown; one line says where and what would be right.
    """
    fleet = read_fleet(path)
    beside = path.parent / fleet.mission
    file = SHIPPED / f"{fleet.mission}.yaml" if fleet.mission in shipped_missions() else beside
    if not file.is_file():
        raise FleetError(
            f"{path}: mission: there is no file {beside}; name one, or one that comes with rsc-swarm: "
            f"{', '.join(shipped_missions())}"
        )
    try:
        mission = parse_mission(read_mission_fields(file), str(file))
    except MissionError as error:
        raise FleetError(f"{path}: {error}") from None
    plan = make_plan(fleet, mission, str(path))
    try:
        check_bodies(plan)
    except FleetError as error:
        raise FleetError(f"{path}: {error}") from None
    return plan


def asked_mission(path: Path, plan: Plan, options: MissionOptions) -> Mission:
    """The mission of the fleet file at ``path`` with what ``options`` say of its radio, its faults and its seed.

    Raises:
        MissionError: they say something else, which the drones would not know of.
    """
    beside = path.parent / plan.fleet.mission
    name = plan.fleet.mission if plan.fleet.mission in shipped_missions() else str(beside)
    own, asked = resolve(MissionOptions(mission=name)), resolve(named(options, name))
    for field in type(own).model_fields:
        if field not in _OF_THE_WORLD and getattr(own, field) != getattr(asked, field):
            raise MissionError(
                f"{field}: the drones fly what {path} says; a world of theirs changes {', '.join(_OF_THE_WORLD)} alone"
            )
    return asked


def keys_of(path: Path, plan: Plan) -> Path | None:
    """The folder of keys of the fleet file at ``path``; None: it has none.

    Raises:
        FleetError: the folder is not there.
    """
    if plan.fleet.keys is None:
        return None
    folder = path.parent / plan.fleet.keys
    if not folder.is_dir():
        raise FleetError(
            f"{path}: keys: there is no folder {folder}; make it with 'rsc-swarm keys {folder} --fleet {path}'"
        )
    return folder


def key_file_of(path: Path, plan: Plan, me: int, own: Path | None = None) -> Path | None:
    """The file of keys of drone ``me``, ``own`` if that is given; None: the fleet has none.

    Raises:
        FleetError: one is given, and the fleet has none; or none is given, and the fleet's are not there.
    """
    if own and plan.fleet.keys is None:
        raise FleetError(f"--credentials {own}: {path} has no keys; name their folder there: keys: keys")
    if own:
        return own
    keys = keys_of(path, plan)
    return keys / login_file(me) if keys else None
