"""Work in several processes."""

from __future__ import annotations

import math

from sheetoflight.workflow.spread import Execution, spread


def test_results_come_in_order_from_several_processes() -> None:
    told = []
    run = Execution(lambda *words: told.append(words), processes=2)
    found = list(spread(math.sqrt, [9.0, 4.0, 25.0, 16.0, 1.0], "roots", run))
    assert found == [3.0, 2.0, 5.0, 4.0, 1.0]
    assert told == [("roots", done, 5) for done in range(6)]


def test_one_process_is_this_one() -> None:
    told = []
    run = Execution(lambda *words: told.append(words))
    assert list(spread(lambda x: -x, [1, 2], "turn", run)) == [-1, -2]
    assert told == [("turn", 0, 2), ("turn", 1, 2), ("turn", 2, 2)]
