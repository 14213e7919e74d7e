"""What can go wrong, as a user meets it.

::

    SheetOfLightError
    ├── InputError (ValueError)              what was given cannot be used; exit status 2
    │   └── FileError (OSError)              a file or folder is missing, damaged or not writable
    ├── UntrustworthyError (ArithmeticError) the input was read, but no trustworthy number
    │                                        can be had from it; exit status 3
    └── ToleranceError                       a check against a tolerance failed; exit status 4

Every error says what was found and what to do about it.
"""

from __future__ import annotations


class SheetOfLightError(Exception):
    """Base of all errors raised on purpose by this package.

    Parameters
    ----------
    what : str
        What was found and what was expected, naming the file, view or marker.
    remedy : str
        How to mend it.
    """

    exit_status = 1

    def __init__(self, what: str, remedy: str) -> None:
        super().__init__(what, remedy)
        self.what = what
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.what} – {self.remedy}"


class InputError(SheetOfLightError, ValueError):
    """The input cannot be used as it stands."""

    exit_status = 2


class FileError(InputError, OSError):
    """A file or folder is missing, damaged, or cannot be written."""

    def __new__(cls, *args: object) -> FileError:
        """Made as an OSError: looked up by name, as Dask does when it sends one, the other
        parent's way would come first, which cannot."""
        return OSError.__new__(cls, *args)

    def __str__(self) -> str:
        return SheetOfLightError.__str__(self)


class UntrustworthyError(SheetOfLightError, ArithmeticError):
    """The input was read, but no trustworthy number can be had from it.

    Parameters
    ----------
    stage : str
        The stage that failed: ``camera``, ``plane``, ``joint`` …
    what, remedy : str
        As for `SheetOfLightError`.
    """

    exit_status = 3

    def __init__(self, stage: str, what: str, remedy: str) -> None:
        super().__init__(f"{stage} stage: {what}", remedy)
        self.stage = stage

    def __reduce__(self) -> tuple[object, ...]:
        reason = self.what.removeprefix(f"{self.stage} stage: ")
        return (type(self), (self.stage, reason, self.remedy))


class ToleranceError(SheetOfLightError):
    """A result lies outside the tolerance it was checked against."""

    exit_status = 4
