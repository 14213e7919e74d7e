"""Files written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.quoting import file_name

_REMEDIES = {
    errno.ENOENT: "make the folder first, or check its name",
    errno.ENOTDIR: "make the folder first, or check its name",
    errno.EACCES: "give yourself permission to write there, or choose another folder",
    errno.EPERM: "give yourself permission to write there, or choose another folder",
    errno.EROFS: "the disk is read-only: choose another folder",
    errno.ENOSPC: "free some space, or choose another disk",
    errno.EDQUOT: "free some space, or choose another disk",
    errno.ENAMETOOLONG: "choose a shorter name",
}


def write_whole(path: str | Path, data: bytes | str) -> None:
    """Write a file beside its place, then move it there in one step.

    Whoever looks sees the old file or the whole new one. A file that is replaced keeps its
    permissions; a symbolic link keeps pointing at the file that is replaced.

    Parameters
    ----------
    path : str or Path
    data : bytes or str
        Text is written as UTF-8, its line ends as they are.

    Raises
    ------
    FileError
        If the folder is missing, or the file cannot be written; nothing is left behind.
    InputError
        If the text holds characters that UTF-8 cannot say (halves of surrogate pairs).
    """
    with written_whole(path) as beside:
        beside.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)


@contextmanager
def written_whole(path: str | Path) -> Iterator[Path]:
    """An empty file beside the place of another, for what writes to a path itself.

    It must be written in place, not unlinked and made anew.

    ::

        with written_whole("cloud.las") as beside:
            points.write(beside)

    What was written moves to its place when the block ends; if it ends by an exception, nothing
    is left behind. Otherwise as `write_whole`.

    Raises
    ------
    FileError
        If the folder is missing, or the file cannot be written.
    InputError
        If text written within holds characters that UTF-8 cannot say.
    """
    try:
        with _replaced(Path(os.path.realpath(path))) as beside:
            yield beside
    except InputError:
        raise
    except UnicodeEncodeError as error:
        raise InputError(
            f"the text for {file_name(path)} holds characters that are no text",
            "check the names of views and files for broken characters",
        ) from error
    except (OSError, ValueError) as error:
        number = error.errno if isinstance(error, OSError) else None
        reason = os.strerror(number) if number else str(error)
        raise FileError(
            f"{file_name(path)} cannot be written ({file_name(reason)})",
            _REMEDIES.get(number or 0, "check the name and the disk"),
        ) from error


@contextmanager
def _replaced(target: Path) -> Iterator[Path]:
    beside = target.with_name(f".sheetoflight-{secrets.token_hex(8)}.tmp")
    mode = _mode_to_keep(target)
    descriptor = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        if mode is not None:
            beside.chmod(mode)
        yield beside
        os.fsync(descriptor)
        beside.replace(target)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    finally:
        os.close(descriptor)


def _mode_to_keep(target: Path) -> int | None:
    """Permissions of the file that is to be replaced; None where there is none."""
    if not target.exists():
        return None
    if not target.is_file():
        raise FileError(
            f"{file_name(target)} is a folder or a device, not a file", "give the name of a file"
        )
    if not os.access(target, os.W_OK):
        raise FileError(
            f"{file_name(target)} is write-protected", "allow writing to it, or choose another name"
        )
    return target.stat().st_mode & 0o7777
