"""Files opened by their kind, with what is wrong with them told in errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames.frame import Stack
from sheetoflight.io.quoting import file_name, one_line


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
