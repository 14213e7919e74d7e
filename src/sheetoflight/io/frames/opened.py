"""Files opened by their kind, with what the libraries say of damage kept in errors."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import cv2

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames.frame import Stack
from sheetoflight.io.quoting import file_name, one_line

_DECODER_LOG: Any = getattr(cv2.utils, "logging", cv2)  # OpenCV 5 and 4 keep it in two places
_SILENT = 0


@contextmanager
def refusing(path: Path, *also: type[Exception]) -> Iterator[None]:
    """Errors of the system, and those named, as a `FileError` that names the file."""
    try:
        yield
    except InputError:
        raise
    except (OSError, *also) as error:
        reason = one_line((isinstance(error, OSError) and error.strerror) or str(error))
        raise FileError(
            f"{file_name(path)} cannot be read ({reason})", "check the file and its disk"
        ) from error


@contextmanager
def silent(logger_name: str) -> Iterator[None]:
    """A library's words on damaged files kept from standard error: they name no file."""
    logger = logging.getLogger(logger_name)
    was_disabled, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = was_disabled


@contextmanager
def silent_decoder() -> Iterator[None]:
    """OpenCV's own words on damaged files kept from standard error: they name no file."""
    level = _DECODER_LOG.getLogLevel()
    _DECODER_LOG.setLogLevel(_SILENT)
    try:
        yield
    finally:
        _DECODER_LOG.setLogLevel(level)


def refuse_no_file(path: Path) -> None:
    """Refuse what is missing, and devices and pipes, which could be read without end."""
    with refusing(path):
        try:
            missing, regular = not path.exists(), path.is_file()
        except ValueError as error:  # a NUL in its name
            raise FileError(f"{file_name(path)} is no name of a file", "check it") from error
    if missing:
        raise FileError(
            f"{file_name(path)} does not exist", "check its name and the folder it is in"
        )
    if not regular:
        raise FileError(f"{file_name(path)} is a device or a pipe", "give the name of a file")


Opener = Callable[[Path, str, int], AbstractContextManager[Stack]]
"""Called with the file, the path of the data set within it, and the most pixels of a frame."""
