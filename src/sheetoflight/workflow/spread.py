"""Work spread over the cores, its results in order."""

from __future__ import annotations

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from typing import Protocol, TypeVar

from sheetoflight.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")
Given = TypeVar("Given", covariant=True)


class Items(Protocol[Given]):
    """What there is to be worked on: its number is known, each is made when it is asked for."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[Given]: ...


_WORTH_A_PROCESS = 4
_UNDER_WAY = 4
"""Items a process: one being worked on, others waiting while a slow one holds up the order."""


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
    function: Callable[[Item], Result], items: Items[Item], what: str, run: Execution = ALONE
) -> Iterator[Result]:
    """Results of ``function(item)`` in the order of the items.

    Only so many items are under way as keep the processes busy: however many there are, the room
    that items and results take stays the same.

    Parameters
    ----------
    function : callable
        Importable by name, so that another process can run it.
    items : sequence, or another of known length
        Asked for one after the other, as they are needed.
    what : str
        What to call the work when its progress is told.
    run : Execution

    Raises
    ------
    InputError
        If a process that shares the work is ended from outside.
    """
    run.progress(what, 0, len(items))
    for done, result in enumerate(_results(function, items, what, run), start=1):
        yield result
        run.progress(what, done, len(items))


def _results(
    function: Callable[[Item], Result], items: Items[Item], what: str, run: Execution
) -> Iterator[Result]:
    if run.processes < 2 or len(items) < _WORTH_A_PROCESS:
        yield from map(function, items)
        return
    # new interpreters rather than forks: libraries with threads of their own do not survive one
    others = set(active_children())
    processes = min(run.processes, len(items))
    pool = ProcessPoolExecutor(
        processes, mp_context=get_context("spawn"), initializer=_one_thread_each
    )
    try:
        yield from _in_order(pool, function, items, processes * _UNDER_WAY)
    except BrokenProcessPool as error:
        raise InputError(
            f"{what}: a process that shared the work was ended from outside",
            "close other programs, memory may be short; then try again",
        ) from error
    except BaseException:  # an interrupt above all: what nobody wants any more is not finished
        for child in set(active_children()) - others:
            child.terminate()
        # the pool's thread must be gone before the interpreter ends: it closes what that would use
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


def _in_order(
    pool: Executor, function: Callable[[Item], Result], items: Iterable[Item], most: int
) -> Iterator[Result]:
    """Results in order, at most so many items handed over and not yet answered for."""
    under_way: deque[Future[Result]] = deque()
    for item in items:
        if len(under_way) == most:
            yield under_way.popleft().result()
        with _interrupts_kept_from_children():
            under_way.append(pool.submit(function, item))
    while under_way:
        yield under_way.popleft().result()


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
