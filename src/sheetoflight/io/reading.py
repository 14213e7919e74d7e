"""Files read whole, with every way a file can be unreadable named."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.quoting import file_name

TEXT_LIMIT_BYTES = 256 * 1024 * 1024
"""A text file larger than this is no rig file, table or calibration."""

_REMEDIES = {
    errno.ENOENT: ("does not exist", "check its name and the folder it is in"),
    errno.ENOTDIR: ("does not exist", "check its name and the folder it is in"),
    errno.EACCES: ("may not be read", "give yourself permission to read it"),
    errno.EPERM: ("may not be read", "give yourself permission to read it"),
}


def read_bytes(path: str | Path, limit: int) -> bytes:
    """The content of a regular file of at most `limit` bytes.

    Raises
    ------
    FileError
        If the file is missing, is no regular file, is too large, or cannot be read.
    """
    name = file_name(path)
    try:
        with _regular(Path(path)).open("rb") as file:
            data = file.read(limit + 1)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        number = error.errno if isinstance(error, OSError) else None
        what, remedy = _REMEDIES.get(
            number or 0,
            (f"cannot be read ({file_name(str(error))})", "check the file and its disk"),
        )
        raise FileError(f"{name} {what}", remedy) from error
    if len(data) > limit:
        raise FileError(f"{name} holds more than {limit} bytes", "check that it is the right file")
    return data


def read_text(path: str | Path, limit: int = TEXT_LIMIT_BYTES) -> str:
    """The text of a UTF-8 file, with or without a byte order mark; line ends as they are.

    Raises
    ------
    FileError
        As `read_bytes`, and if the content is empty, binary or not UTF-8; the line is named.
    """
    name, data = file_name(path), read_bytes(path, limit)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FileError(f"{name} is UTF-16 text, expected UTF-8", "save it again as UTF-8")
    if b"\0" in data:
        line = _line_at(data, data.index(b"\0"))
        raise FileError(
            f"{name} line {line} holds a NUL byte; this is a binary or a damaged file",
            "give a text file",
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = _line_at(data, error.start)
        raise FileError(
            f"{name} line {line} is not UTF-8 text", "save it again as UTF-8"
        ) from error
    if not text.strip():
        raise FileError(f"{name} is empty", "check that it was written to the end")
    return text


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Put the file's name before what an `InputError` from within says."""
    try:
        yield
    except FileError:
        raise
    except InputError as error:
        raise InputError(f"{file_name(path)}: {error.what}", error.remedy) from error


def _regular(path: Path) -> Path:
    """The path itself, where it is a file: a device or a pipe could be read without end."""
    if path.is_dir():
        raise FileError(f"{file_name(path)} is a folder", "give the name of a file")
    if path.exists() and not path.is_file():
        raise FileError(f"{file_name(path)} is a device or a pipe", "give the name of a file")
    return path


def _line_at(data: bytes, offset: int) -> int:
    return data.count(b"\n", 0, offset) + 1
