"""Folders made where they are to be written into."""

from __future__ import annotations

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
