"""Folders made where they are to be written into."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sheetoflight.errors import FileError
from sheetoflight.io.quoting import file_name


def made_folder(path: str | Path) -> Path:
    """The folder, made with its parents where it is missing.

    Raises
    ------
    FileError
        If it cannot be made.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise FileError(
            f"folder {file_name(folder)} cannot be made ({reason})",
            "name another folder, or change who may write there",
        ) from error
    return folder


@contextmanager
def working_folder(beside: Path) -> Iterator[Path]:
    """A folder beside another one, gone at the end whatever happens.

    Raises
    ------
    FileError
        If it cannot be made.
    """
    try:
        work = Path(tempfile.mkdtemp(prefix=f".{beside.name}-", dir=beside.parent))
    except OSError as error:
        raise FileError(
            f"{file_name(beside)} cannot be written ({error.strerror})",
            "name another folder, or change who may write there",
        ) from error
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)


def put_in_place(work: Path, folder: Path, replaced: Iterable[str]) -> None:
    """Move all that a working folder holds into a folder, `replaced` things of which go first.

    Raises
    ------
    FileError
        If something cannot be moved.
    """
    made_folder(folder)
    try:
        for name in replaced:
            old = folder / name
            if old.is_dir():
                shutil.rmtree(old)
            else:
                old.unlink(missing_ok=True)
        for path in sorted(work.iterdir()):
            path.rename(folder / path.name)
    except OSError as error:
        raise FileError(
            f"{file_name(folder)} cannot be written ({error.strerror})",
            "name another folder, or change who may write there",
        ) from error
