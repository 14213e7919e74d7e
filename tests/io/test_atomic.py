"""A file is there whole, or it is not there."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.atomic import write_whole


@pytest.mark.parametrize("data", [b"", b"\x00\xff\r\n", "μm – 3 px\r\n"], ids=repr)
def test_what_is_written_is_there(tmp_path: Path, data: bytes | str):
    path = tmp_path / "file"
    write_whole(path, data)
    assert path.read_bytes() == (data if isinstance(data, bytes) else data.encode())
    assert list(tmp_path.iterdir()) == [path]


def test_a_replaced_file_keeps_its_permissions(tmp_path: Path):
    path = tmp_path / "file"
    path.write_text("old")
    path.chmod(0o640)
    write_whole(path, "new")
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_new_file_has_the_permissions_the_user_gives_new_files(tmp_path: Path):
    (tmp_path / "usual").touch()
    write_whole(tmp_path / "file", "new")
    assert (tmp_path / "file").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_a_link_still_points_at_the_file_it_pointed_at(tmp_path: Path):
    (tmp_path / "file").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "file"
    path.write_text("old")
    monkeypatch.setattr(os if step == "fsync" else Path, step, full)
    with pytest.raises(FileError, match=r"file cannot be written \(No space.*\) – free some space"):
        write_whole(path, "new")
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupt_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "file", "new")
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []


def test_no_permission_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refused(*_: object) -> int:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(os, "open", refused)
    with pytest.raises(FileError, match=r"Permission denied\) – give yourself permission"):
        write_whole(tmp_path / "file", "new")


def test_a_write_protected_file_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "file"
    path.write_text("old")
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(FileError, match="write-protected – allow writing"):
        write_whole(path, "new")
    assert path.read_text() == "old"


def test_a_missing_folder_is_named(tmp_path: Path):
    with pytest.raises(FileError, match=r"nowhere/file cannot be written .* – make the folder"):
        write_whole(tmp_path / "nowhere" / "file", "new")


def test_a_folder_that_is_a_file_is_named(tmp_path: Path):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match=r"file/file cannot be written .* – make the folder"):
        write_whole(tmp_path / "file" / "file", "new")


def test_a_folder_is_no_file(tmp_path: Path):
    with pytest.raises(FileError, match="is a folder or a device"):
        write_whole(tmp_path, "new")


def test_a_device_is_not_replaced(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="is a folder or a device"):
        write_whole(tmp_path / "pipe", "new")
    assert (tmp_path / "pipe").is_fifo()


def test_a_name_that_no_file_can_have(tmp_path: Path):
    with pytest.raises(FileError, match="cannot be written"):
        write_whole(tmp_path / "a\0b", "new")
    with pytest.raises(FileError, match="choose a shorter name"):
        write_whole(tmp_path / ("a" * 300), "new")
    assert list(tmp_path.iterdir()) == []


def test_text_that_is_no_text(tmp_path: Path):
    with pytest.raises(InputError, match="characters that are no text"):
        write_whole(tmp_path / "file", "\udcff")
    assert list(tmp_path.iterdir()) == []
