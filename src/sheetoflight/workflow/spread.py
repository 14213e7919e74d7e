"""Work spread over the cores, its results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many parts are done, and how many there are."""

_WORTH_A_PROCESS = 4


def no_progress(what: str, done: int, total: int) -> None:
    """Tell nobody."""


def spread(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    what: str,
    progress: Progress = no_progress,
    processes: int | None = None,
) -> Iterator[Result]:
    """Results of ``function(item)`` in the order of the items.

    Parameters
    ----------
    function : callable
        Importable by name, so that another process can run it.
    items : sequence
    what : str
        What to call the work in `progress`.
    progress : callable
    processes : int, optional
        How many processes; by default as many as there are cores for this process.
    """
    processes = min(processes or len(os.sched_getaffinity(0)), len(items))
    progress(what, 0, len(items))
    if processes < 2 or len(items) < _WORTH_A_PROCESS:
        for done, item in enumerate(items, start=1):
            yield function(item)
            progress(what, done, len(items))
        return
    # new interpreters rather than forks: libraries with threads of their own do not survive one
    with ProcessPoolExecutor(
        processes, mp_context=get_context("spawn"), initializer=_one_thread_each
    ) as pool:
        for done, result in enumerate(pool.map(function, items), start=1):
            yield result
            progress(what, done, len(items))


def _one_thread_each() -> None:
    import cv2

    cv2.setNumThreads(1)
