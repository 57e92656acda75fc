"""A file is complete or not there, and a disk that is full is one line."""

import errno
import os
import stat
from contextlib import suppress
from pathlib import Path

import pytest

from protocols.whole_file import WriteError, whole_file, write_whole


def test_text_and_bytes_land_under_their_name(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.json", "µ\n")
    write_whole(tmp_path / "b.bin", b"\x00\xff")
    assert (tmp_path / "a.json").read_bytes() == "µ\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\xff"
    assert sorted(os.listdir(tmp_path)) == ["a.json", "b.bin"]


def test_who_is_interrupted_in_mid_file_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_whole(path, "old")
    with suppress(KeyboardInterrupt), whole_file(path) as file:
        file.write(b"half of the n")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["report.json"]


def test_a_full_disk_is_one_line_and_costs_only_the_new_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "report.json"
    write_whole(path, "old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(WriteError) as caught:
        write_whole(path, "new")
    assert str(caught.value) == f"{path}: cannot be written (No space left on device)"
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["report.json"]


def test_what_is_no_file_is_written_to_and_stays_what_it_is(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, "all of it")
    assert os.read(reader, 100) == b"all of it"
    os.close(reader)
    assert pipe.is_fifo()
    with pytest.raises(WriteError, match=r"/dev/full: cannot be written \(No space left on device\)"):
        write_whole(Path("/dev/full"), "x")
    assert Path("/dev/full").is_char_device()


def test_a_pipe_that_nobody_reads_and_links_in_a_circle_are_told_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises(WriteError, match=r"pipe: cannot be written \(nobody reads from this pipe\)"):
        write_whole(tmp_path / "pipe", "x")
    with pytest.raises(WriteError, match=r"circle: cannot be written \(Too many levels of symbolic links\)"):
        write_whole(tmp_path / "circle", "x")


def test_a_link_goes_on_leading_where_it_leads(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "report.json")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "report.json").read_text() == "new"


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(WriteError, match=r"nowhere/x: cannot be written \(No such file or directory\)"):
        write_whole(tmp_path / "nowhere" / "x", "")


def test_where_no_file_can_be_without_a_name_it_is_whole_and_private_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true_open = os.open

    def refuse(path: str, flags: int, mode: int = 0o777) -> int:
        if flags & os.O_TMPFILE == os.O_TMPFILE:
            raise OSError(errno.EOPNOTSUPP, "no such thing here")
        return true_open(path, flags, mode)

    monkeypatch.setattr(os, "open", refuse)
    for text in ("one", "two"):
        write_whole(tmp_path / "file", text, private=True)
        assert (tmp_path / "file").read_text() == text
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o600
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
