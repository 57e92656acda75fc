"""Files of keys: ``agent-3.json`` is all that drone 3 needs, ``world.json`` all that the world needs.

Only their owner may read them.
"""

import os
import stat
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

from protocols.errors import BrokenError, SwarmError
from protocols.foreign_file import opened_file
from protocols.whole_file import WriteError, write_whole
from protocols.wire import certificates
from protocols.wire.endpoints import is_secret, refuse_plain_text
from protocols.wire.keys import login_file
from protocols.wire.login import Certificates, Login, OperatorLogin
from rsc_swarm.machine.leaving import nobody_asks, passing_folder
from world.server.credentials import Credentials, FleetHosts, make_fleet_keys, make_keys

HERE = ("localhost", "127.0.0.1", "::1")  # where every world's certificate is good, to try it on one machine
_WORLD, _GROUND, _MIXED = "world.json", "ground.json", "mixed.json"
_FOR_OTHERS = 0o077
_LONGEST = 1 << 16  # bytes: three times what the largest swarm needs
_Kind = TypeVar("_Kind")


class KeyFileError(BrokenError, RuntimeError):
    """A file of keys cannot be used; one line says why."""


class KeyFolderError(SwarmError, RuntimeError):
    """Keys cannot be put there, or not made like that; one line says why."""


def make_key_files(
    folder: Path, swarm: str, agents: int, addresses: Sequence[str], days: int, overwrite: bool
) -> None:
    """Make the keys of a swarm: a file for the world and one for each drone.

    Raises:
        KeyFolderError: ``folder`` holds keys and ``overwrite`` is not set, or there cannot be such keys.
        protocols.whole_file.WriteError: they cannot be written; what was in ``folder`` is as it was.
    """
    try:
        keys = make_keys(swarm, agents, addresses, days, datetime.now(UTC))
    except ValueError as error:
        raise KeyFolderError(str(error)) from None
    files = {login_file(login.agent): login.to_json() for login in keys.logins}
    _write_keys(folder, {**files, _WORLD: keys.world.to_json()}, overwrite)


def make_fleet_key_files(folder: Path, swarm: str, fleet: FleetHosts, days: int, overwrite: bool) -> None:
    """Make the keys of a fleet: a file for the operator, one for each drone, and one for its world if it has one.

    Raises:
        As `make_key_files`.
    """
    try:
        made = make_fleet_keys(swarm, fleet, days, datetime.now(UTC))
    except ValueError as error:
        raise KeyFolderError(str(error)) from None
    files = {login_file(login.agent): login.to_json() for login in made.logins}
    files[_GROUND] = made.operator.to_json()
    if made.world:
        files[_MIXED] = made.world.to_json()
    _write_keys(folder, files, overwrite)


def _write_keys(folder: Path, files: Mapping[str, str], overwrite: bool) -> None:
    """All of them or none, by their names."""
    old = [path for name in ("agent-*.json", _WORLD, _GROUND, _MIXED) for path in folder.glob(name)]
    if old and not overwrite:
        raise KeyFolderError(
            f"{folder}: holds keys already; give a new directory, or --overwrite: then no old key is good any more"
        )
    _make_private(folder)
    try:
        with passing_folder(".new-", folder) as new:
            for name, text in files.items():
                write_whole(new / name, text, private=True)
            with nobody_asks():  # new keys and old ones side by side would be good for nothing
                made = {file.replace(folder / file.name) for file in list(new.iterdir())}
                for file in set(old) - made:
                    file.unlink()
    except (WriteError, OSError) as error:
        with suppress(OSError):  # it holds other things
            folder.rmdir()
        if isinstance(error, WriteError):
            raise WriteError(str(error).replace(str(new), str(folder))) from None
        raise WriteError(f"{folder}: cannot be written ({error.strerror})") from None


def make_login_files(folder: Path, swarm: str, agents: int) -> Credentials:
    """Passwords for one flight on this machine: a file for each drone.

    Raises:
        KeyFolderError: ``folder`` holds keys that are good for more. protocols.whole_file.WriteError: they cannot be written.
    """
    if (folder / _WORLD).exists():
        raise KeyFolderError(
            f"{folder}: holds the keys of a swarm; use them with --keys, or give another directory"
        )
    credentials = Credentials.fresh(swarm, agents)
    _make_private(folder)
    for agent in range(agents):
        write_whole(folder / login_file(agent), credentials.login(agent).to_json(), private=True)
    return credentials


def read_login(file: Path, agent: int, endpoint: str, plain_text: bool) -> Login:
    """Drone ``agent``'s own, for a world at ``endpoint``.

    Raises:
        KeyFileError: it cannot be read, is no login, is another drone's, or others may read it.
        protocols.wire.endpoints.PlainTextError: the way there is plain text, and nobody said that it may be.
    """
    if not plain_text:
        refuse_plain_text(endpoint)
    return _own_login(file, agent)


def read_logins(folder: Path, agents: Sequence[int], endpoint: str, plain_text: bool) -> list[Login]:
    """Those of many drones of one swarm from their folder, for a world at ``endpoint``.

    Raises:
        KeyFileError, protocols.wire.endpoints.PlainTextError: as `read_login`, or they are not all of one swarm, or
            it is smaller.
    """
    logins: list[Login] = []
    for agent in agents:
        file = folder / login_file(agent)
        if not file.exists() and (known := _size_of_swarm(folder)) and agent >= known:
            raise KeyFileError(
                f"{folder}: holds the keys of {known} drones, 0 to {known - 1}; there is no drone {agent}"
            )
        login = read_login(file, agent, endpoint, plain_text)
        if logins and login.swarm != logins[0].swarm:
            raise KeyFileError(
                f"{file}: is for swarm {login.swarm!r}, and that of agent {logins[0].agent} for {logins[0].swarm!r}; "
                "use the files of one swarm"
            )
        logins.append(login)
    return logins


def _size_of_swarm(folder: Path) -> int | None:
    """Of how many drones the swarm is whose keys lie there, if any file there says so."""
    for file in sorted(folder.glob("agent-*.json")):
        with suppress(KeyFileError):
            if seals := _read(file, certificates.read_login).seals:
                return len(seals.public_keys)
    return None


def read_fleet_login(file: Path, swarm: str, agent: int, host: str) -> Login:
    """Drone ``agent``'s own of a fleet's keys, good at ``host``.

    Raises:
        KeyFileError: as `read_login`, or it is for another swarm or host.
    """
    login = _own_login(file, agent)
    _check_fleet(file, login.certificates, login.swarm, swarm, host)
    return login


def read_operator_login(folder: Path, swarm: str, host: str) -> OperatorLogin:
    """The operator's own, as `read_fleet_login`."""
    return _peer_login(folder / _GROUND, certificates.read_operator_login, swarm, host)


def read_world_login(folder: Path, swarm: str, host: str) -> OperatorLogin:
    """Those of the world of a fleet in mixed reality, as `read_fleet_login`."""
    return _peer_login(folder / _MIXED, certificates.read_mixed_login, swarm, host)


def _peer_login(file: Path, reader: Callable[[str], OperatorLogin], swarm: str, host: str) -> OperatorLogin:
    login = _read(file, reader)
    _check_fleet(file, login.certificates, login.swarm, swarm, host)
    return login


def _check_fleet(file: Path, own: Certificates | None, theirs: str, swarm: str, host: str) -> None:
    again = f"make keys with 'rsc-swarm keys {file.parent} --fleet FILE --overwrite'"
    if theirs != swarm:
        raise KeyFileError(f"{file}: is for swarm {theirs!r}, and the mission is for {swarm!r}; {again}")
    if own is None:
        raise KeyFileError(f"{file}: has no certificate; {again}")
    try:
        certificates.refuse_other_address(own, host, again)
        certificates.refuse_out_of_date(own, datetime.now(UTC))
    except ValueError as error:
        raise KeyFileError(f"{file}: {error}") from None


def _own_login(file: Path, agent: int) -> Login:
    login = _read(file, certificates.read_login)
    if login.agent != agent:
        raise KeyFileError(
            f"{file}: is that of agent {login.agent}; give agent {agent} its own, {login_file(agent)}"
        )
    return login


def read_credentials(path: Path, swarm: str, agents: int) -> Credentials:
    """The world's own, from ``world.json`` or the folder that it lies in.

    Raises:
        KeyFileError: it cannot be read, is no world's, others may read it, or it is for another swarm or a smaller one.
    """
    file = path / _WORLD if path.is_dir() else path
    credentials = _read(file, Credentials.from_json)
    if credentials.swarm != swarm:
        raise KeyFileError(
            f"{file}: is for swarm {credentials.swarm!r}, and the mission is for {swarm!r}; "
            f"make keys with 'rsc-swarm keys --swarm {swarm}', or set the mission's swarm"
        )
    if len(credentials.passwords) < agents:
        raise KeyFileError(
            f"{file}: is for {len(credentials.passwords)} drones, and the mission is for {agents}; "
            f"make keys with 'rsc-swarm keys --agents {agents}'"
        )
    return Credentials(swarm, credentials.passwords[:agents], credentials.certificates)


def check_listening(listen: Sequence[str], plain_text: bool) -> None:
    """Raises protocols.wire.endpoints.PlainTextError if one of them carries plain text off this machine unasked."""
    for endpoint in listen:
        if not plain_text and not is_secret(endpoint):
            refuse_plain_text(endpoint)


def _make_private(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise KeyFolderError(f"{folder}: cannot be made ({error.strerror})") from None


def _read(file: Path, reader: Callable[[str], _Kind]) -> _Kind:
    """What ``reader`` makes of a file that is ours; one that is another's, root's say, was given to us to read."""
    try:
        with opened_file(file) as opened:
            found, data = os.fstat(opened.fileno()), opened.read(_LONGEST + 1)
        if len(data) > _LONGEST:
            raise KeyFileError(
                f"{file}: is too long for a file of keys; use one as 'rsc-swarm keys' writes it"
            )
        read = reader(data.decode())
    except OSError as error:
        raise KeyFileError(f"{file}: cannot be read ({error.strerror})") from None
    except ValueError as error:  # UnicodeDecodeError is one
        text = "is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error)
        raise KeyFileError(f"{file}: {text}") from None
    if found.st_uid == os.geteuid() and stat.S_IMODE(found.st_mode) & _FOR_OTHERS:
        raise KeyFileError(f"{file}: others may read it; its keys are worth nothing then: chmod 600 {file}")
    return read
