"""Work spread over the cores, its results in order."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from typing import TypeVar

from sheetoflight.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

_WORTH_A_PROCESS = 4


def tell_nobody(what: str, done: int, total: int) -> None:
    """Say nothing of the progress."""


@dataclass(frozen=True)
class Execution:
    """How a long step runs.

    Parameters
    ----------
    progress : callable
        Called with what is being done, how many parts are done, and how many there are.
    processes : int
        How many processes share the work. More than one starts new interpreters, which a script
        survives only if it guards its own start with ``if __name__ == "__main__":``; hence one
        is the default.
    """

    progress: Callable[[str, int, int], None] = tell_nobody
    processes: int = 1


ALONE = Execution()
"""In this process, telling nobody."""


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0))


def spread(
    function: Callable[[Item], Result], items: Sequence[Item], what: str, run: Execution = ALONE
) -> Iterator[Result]:
    """Results of ``function(item)`` in the order of the items.

    Parameters
    ----------
    function : callable
        Importable by name, so that another process can run it.
    items : sequence
    what : str
        What to call the work when its progress is told.
    run : Execution
    """
    run.progress(what, 0, len(items))
    if run.processes < 2 or len(items) < _WORTH_A_PROCESS:
        for done, item in enumerate(items, start=1):
            yield function(item)
            run.progress(what, done, len(items))
        return
    # new interpreters rather than forks: libraries with threads of their own do not survive one
    others = set(active_children())
    pool = ProcessPoolExecutor(
        min(run.processes, len(items)),
        mp_context=get_context("spawn"),
        initializer=_one_thread_each,
    )
    try:
        with _interrupts_kept_from_children():
            results = pool.map(function, items)
        for done, result in enumerate(results, start=1):
            yield result
            run.progress(what, done, len(items))
    except BrokenProcessPool as error:
        raise InputError(
            f"{what}: a process that shared the work was ended from outside",
            "close other programs, memory may be short; then try again",
        ) from error
    except BaseException:  # an interrupt above all: do not wait for what nobody wants any more
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - others:
            child.terminate()
        raise
    pool.shutdown()


def _one_thread_each() -> None:
    """The processes share the cores already; read by the libraries when they load."""
    os.environ["OPENCV_FOR_THREADS_NUM"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"


@contextmanager
def _interrupts_kept_from_children() -> Iterator[None]:
    """Processes started meanwhile leave Ctrl-C to this one, which then ends them in order."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
