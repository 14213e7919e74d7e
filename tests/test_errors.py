"""Errors say what was found and what to do."""

from __future__ import annotations

import pickle

import pytest

from sheetoflight.errors import (
    FileError,
    InputError,
    SheetOfLightError,
    ToleranceError,
    UntrustworthyError,
)

EVERY = [
    InputError("what", "do"),
    FileError("what", "do"),
    UntrustworthyError("camera", "what", "do"),
    ToleranceError("what", "do"),
]


@pytest.mark.parametrize("error", EVERY, ids=lambda error: type(error).__name__)
def test_an_error_is_one_line_with_its_remedy(error: SheetOfLightError) -> None:
    assert str(error).endswith("what – do")
    assert "\n" not in str(error)


@pytest.mark.parametrize("error", EVERY, ids=lambda error: type(error).__name__)
def test_an_error_survives_its_way_from_another_process(error: SheetOfLightError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)


def test_an_untrustworthy_result_names_its_stage() -> None:
    assert str(UntrustworthyError("plane", "what", "do")) == "plane stage: what – do"


def test_errors_are_builtins_too() -> None:
    assert issubclass(InputError, ValueError)
    assert issubclass(FileError, OSError)
    assert issubclass(UntrustworthyError, ArithmeticError)
    assert [error.exit_status for error in EVERY] == [2, 2, 3, 4]
