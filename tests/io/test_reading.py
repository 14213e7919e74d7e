"""A file that cannot be read says which it is, and why."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sheetoflight.errors import FileError
from sheetoflight.io.reading import read_bytes, read_text


def test_text_comes_as_it_is_without_its_byte_order_mark(tmp_path: Path):
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbf\xc3\xa4\r\nb")
    assert read_text(tmp_path / "file") == "ä\r\nb"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty – check"),
        (b" \n\n", "is empty – check"),
        (b"a\nb\n\xff\n", "line 3 is not UTF-8 text – save it again as UTF-8"),
        (b"a\nb\0\n", "line 2 holds a NUL byte"),
        ("a\nb".encode("utf-16"), "is UTF-16 text, expected UTF-8"),
    ],
    ids=["empty", "blank", "not UTF-8", "NUL", "UTF-16"],
)
def test_what_is_no_text(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(FileError, match=f"file {message}"):
        read_text(tmp_path / "file")


def test_the_limit_is_the_largest_that_is_read(tmp_path: Path):
    (tmp_path / "file").write_bytes(b"12345")
    assert read_bytes(tmp_path / "file", 5) == b"12345"
    with pytest.raises(FileError, match="holds more than 4 bytes"):
        read_bytes(tmp_path / "file", 4)


def test_what_is_no_file(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="missing does not exist – check its name"):
        read_bytes(tmp_path / "missing", 1)
    with pytest.raises(FileError, match="is a folder – give the name of a file"):
        read_bytes(tmp_path, 1)
    with pytest.raises(FileError, match="pipe is a device or a pipe"):
        read_bytes(tmp_path / "pipe", 1)
    with pytest.raises(FileError, match=r"a\\x00b"):
        read_bytes(tmp_path / "a\0b", 1)


def test_no_permission_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refused(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    (tmp_path / "file").touch()
    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(FileError, match="file may not be read – give yourself permission"):
        read_bytes(tmp_path / "file", 1)


def test_a_name_with_a_line_end_is_shown_on_one_line(tmp_path: Path):
    with pytest.raises(FileError) as caught:
        read_text(tmp_path / "a\nb")
    assert "\n" not in str(caught.value)
    assert r"a\nb does not exist" in str(caught.value)
