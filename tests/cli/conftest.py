"""What most tests of commands share."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from sheetoflight.cli.main import main


@pytest.fixture
def sol(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command; give its exit status, standard output and standard error."""

    def run(*words: object) -> tuple[int, str, str]:
        status = main([str(word) for word in words])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run
