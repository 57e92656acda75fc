"""Files of keys: made once, never overwritten unasked, for their owner's eyes only."""

import os
import stat
from pathlib import Path

import pytest

from protocols.errors import SwarmError
from protocols.whole_file import WriteError
from protocols.wire.endpoints import PlainTextError
from protocols.wire.login import Login
from rsc_swarm.flight import key_files
from rsc_swarm.flight.key_files import (
    KeyFileError,
    KeyFolderError,
    check_listening,
    make_key_files,
    make_login_files,
    read_credentials,
    read_login,
    read_logins,
)

TLS = "tls/127.0.0.1:7447"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("swarm") / "new" / "keys"
    make_key_files(folder, "wedge", 3, ["127.0.0.1"], 9, overwrite=False)
    return folder


def test_a_drone_needs_one_file_and_the_world_another(folder: Path) -> None:
    assert sorted(file.name for file in folder.iterdir()) == [
        "agent-0.json",
        "agent-1.json",
        "agent-2.json",
        "world.json",
    ]
    world = read_credentials(folder, "wedge", 3)
    assert read_credentials(folder / "world.json", "wedge", 2).passwords == world.passwords[:2]
    for agent in range(3):
        login = read_login(folder / f"agent-{agent}.json", agent, TLS, plain_text=False)
        assert login.password == world.passwords[agent]
        assert login.certificates
        assert world.certificates
        assert login.certificates.authority == world.certificates.authority


def test_only_their_owner_may_read_them(folder: Path) -> None:
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {stat.S_IMODE(file.stat().st_mode) for file in folder.iterdir()} == {0o600}


def test_each_secret_is_in_its_owners_file_only(folder: Path) -> None:
    texts = {file.name: file.read_text() for file in folder.iterdir()}
    for agent in range(3):
        login = Login.from_json(texts[f"agent-{agent}.json"])
        assert login.certificates
        key = login.certificates.private_key.splitlines()[1]
        assert [name for name, text in texts.items() if key in text] == [f"agent-{agent}.json"]
        assert sorted(name for name, text in texts.items() if login.password in text) == [
            f"agent-{agent}.json",
            "world.json",
        ]


def test_keys_are_not_overwritten_unasked(tmp_path: Path) -> None:
    make_key_files(tmp_path, "wedge", 3, ["127.0.0.1"], 9, overwrite=False)
    first = (tmp_path / "agent-0.json").read_text()
    with pytest.raises(KeyFolderError, match="holds keys already; give a new directory, or --overwrite"):
        make_key_files(tmp_path, "wedge", 2, ["127.0.0.1"], 9, overwrite=False)
    with pytest.raises(KeyFolderError, match="holds the keys of a swarm; use them with --keys"):
        make_login_files(tmp_path, "wedge", 3)
    assert (tmp_path / "agent-0.json").read_text() == first
    make_key_files(tmp_path, "wedge", 2, ["127.0.0.1"], 9, overwrite=True)
    assert (tmp_path / "agent-0.json").read_text() != first
    assert not (tmp_path / "agent-2.json").exists()  # an old one would be good for nothing


def test_a_disk_that_fills_leaves_the_keys_as_they_were(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    make_key_files(old, "wedge", 3, ["127.0.0.1"], 9, overwrite=False)
    before = {file.name: file.read_text() for file in old.iterdir()}
    whole = key_files.write_whole

    def filling(path: Path, content: str, private: bool) -> None:
        if path.name == "world.json":
            raise WriteError(f"{path}: cannot be written (No space left on device)")
        whole(path, content, private)

    monkeypatch.setattr(key_files, "write_whole", filling)
    for folder, overwrite in ((old, True), (new, False)):
        line = rf"^{folder}/world.json: cannot be written \(No space left on device\)$"
        with pytest.raises(WriteError, match=line):
            make_key_files(folder, "wedge", 2, ["127.0.0.1"], 9, overwrite)
    assert {file.name: file.read_text() for file in old.iterdir()} == before
    assert not new.exists()


def test_logins_of_one_flight_are_made_afresh(tmp_path: Path) -> None:
    path = tmp_path / "agent-1.json"
    path.write_text("an older one, readable by all")
    first = make_login_files(tmp_path, "wedge", 2)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_login(path, 1, "tcp/127.0.0.1:7447", plain_text=False) == first.login(1)
    assert make_login_files(tmp_path, "wedge", 2).passwords != first.passwords


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o602, 0o611])
def test_a_file_that_others_may_read_is_refused(tmp_path: Path, mode: int) -> None:
    path = tmp_path / "agent-1.json"
    make_login_files(tmp_path, "wedge", 2)
    path.chmod(mode)
    with pytest.raises(KeyFileError, match=rf"^{path}: others may read it; .*: chmod 600 {path}$"):
        read_login(path, 1, TLS, plain_text=False)


def test_a_long_file_is_not_read_to_its_end(tmp_path: Path) -> None:
    with (tmp_path / "long").open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(KeyFileError, match=r"long: is too long for a file of keys; use one as "):
        read_login(tmp_path / "long", 1, TLS, plain_text=False)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_a_file_that_somebody_else_gave_to_read_is_taken(tmp_path: Path) -> None:
    """As systemd does: the file is root's, and whoever may read it was chosen there."""
    path = tmp_path / "agent-1.json"
    make_login_files(tmp_path, "wedge", 2)
    path.chmod(0o440)
    os.chown(path, 12345, 0)
    assert read_login(path, 1, TLS, plain_text=False).agent == 1


def test_what_does_not_fit_the_flight_is_named(folder: Path, tmp_path: Path) -> None:
    for tried, trouble in {
        lambda: read_login(
            folder / "agent-1.json", 0, TLS, False
        ): "is that of agent 1; give agent 0 its own",
        lambda: read_login(folder / "world.json", 0, TLS, False): "is not an agent's login",
        lambda: read_login(folder / "agent-7.json", 7, TLS, False): "No such file",
        lambda: read_credentials(folder / "agent-1.json", "wedge", 3): "is not the world's file",
        lambda: read_credentials(folder, "rsc", 3): "is for swarm 'wedge', and the mission is for 'rsc'",
        lambda: read_credentials(folder, "wedge", 4): "is for 3 drones, and the mission is for 4",
        lambda: read_credentials(tmp_path, "wedge", 3): "No such file",
    }.items():
        with pytest.raises(KeyFileError, match=trouble) as told:
            tried()
        assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("swarm", "agents", "addresses", "trouble"),
    [
        ("a/b", 3, ["127.0.0.1"], "is not a swarm name"),
        ("rsc", 0, ["127.0.0.1"], "1 to 250 agents, not 0"),
        ("rsc", 251, ["127.0.0.1"], "1 to 250 agents, not 251"),
        ("rsc", 3, ["10.0.0.1:7447"], "is not an address of the world"),
    ],
)
def test_keys_that_cannot_be_are_not_made(
    tmp_path: Path, swarm: str, agents: int, addresses: list[str], trouble: str
) -> None:
    with pytest.raises(SwarmError, match=trouble):
        make_key_files(tmp_path / "keys", swarm, agents, addresses, 9, overwrite=False)
    assert not (tmp_path / "keys").exists()


def test_plain_text_is_only_by_an_explicit_word(folder: Path) -> None:
    away, here = "tcp/10.0.0.1:7447", "tcp/127.0.0.1:7447"
    check_listening([TLS, here], plain_text=False)
    check_listening([TLS, here, away], plain_text=True)
    with pytest.raises(PlainTextError, match="plain text"):
        check_listening([TLS, here, away], plain_text=False)
    assert read_login(folder / "agent-1.json", 1, away, plain_text=True)
    with pytest.raises(PlainTextError, match="plain text"):
        read_login(folder / "agent-1.json", 1, away, plain_text=False)


def test_many_drones_find_their_files_in_one_folder(folder: Path) -> None:
    assert [login.agent for login in read_logins(folder, (2, 0), TLS, plain_text=False)] == [2, 0]
    with pytest.raises(KeyFileError, match=r"holds the keys of 3 drones, 0 to 2; there is no drone 3$"):
        read_logins(folder, range(4), TLS, plain_text=False)


def test_a_file_that_is_missing_or_of_another_swarm_is_named(folder: Path, tmp_path: Path) -> None:
    for agent in (0, 1):
        (tmp_path / f"agent-{agent}.json").write_text((folder / f"agent-{agent}.json").read_text())
        (tmp_path / f"agent-{agent}.json").chmod(0o600)
    with pytest.raises(KeyFileError, match=r"/agent-2.json: cannot be read \(No such file or directory\)$"):
        read_logins(tmp_path, range(3), TLS, plain_text=False)
    make_key_files(tmp_path / "other", "arrow", 3, ["127.0.0.1"], 9, overwrite=False)
    (tmp_path / "other" / "agent-2.json").rename(tmp_path / "agent-2.json")
    with pytest.raises(
        KeyFileError, match=r"/agent-2.json: is for swarm 'arrow', and that of agent 0 for 'wedge'"
    ):
        read_logins(tmp_path, range(3), TLS, plain_text=False)
