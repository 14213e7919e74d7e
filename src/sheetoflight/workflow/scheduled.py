"""Work spread over the computers of a dask cluster, its results in order."""

from __future__ import annotations

import asyncio
import logging
import math
import socket
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar, cast

from sheetoflight.errors import InputError
from sheetoflight.workflow.spread import ALONE, Execution

if TYPE_CHECKING:
    from distributed import Client, Future

Item = TypeVar("Item")
Result = TypeVar("Result")

_CONNECTING_S = 10.0
_PATIENCE_S = 30.0
"""How long the work may stand still, no worker being there, before it is given up."""

_LOOK_S = 2.0
_RETRIES = 3
_CHUNKS_PER_THREAD = 4
"""A worker that is lost takes no more than such a part of the work with it."""

_LARGEST_CHUNK = 8
_SCHEMES = ("", "tcp", "tls")
_SAME = ("sheetoflight", "numpy", "scipy")
"""Packages of which another version could mean other numbers."""

_UNREADABLE = "Error during deserialization"
"""How dask begins its complaint of functions that the scheduler does not have."""

_ONE_AT_A_TIME = Lock()
"""Workers may have several threads; what they are given was made for a process of its own."""


def spread_on_cluster(
    address: str,
    function: Callable[[Item], Result],
    items: Sequence[Item],
    what: str,
    run: Execution = ALONE,
) -> Iterator[Result]:
    """Results of ``function(item)`` in the order of the items, made by the workers of a cluster.

    What a worker had under way or not yet handed over when it was lost is made again by another.

    Parameters
    ----------
    address : str
        Of the dask scheduler, as ``tcp://10.0.0.1:8786``.
    function : callable
        Importable by name, so that the workers can run it.
    items : sequence
    what : str
        What to call the work when its progress is told.
    run : Execution
        Its number of processes does not matter here.

    Raises
    ------
    InputError
        If dask is not installed, the scheduler does not answer, its workers have other versions
        than this process, or they are lost for good.
    """
    run.progress(what, 0, len(items))
    done = 0
    with _connected(address) as client, _dask_silent():
        for part in _parts(client, function, items, what):
            for result in part:
                done += 1
                yield result
                run.progress(what, done, len(items))


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """A client of the scheduler whose workers can be worked with."""
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "a scheduler is given, but dask is not installed",
            "pip install sheetoflight[cluster]",
        ) from error
    with _dask_silent():
        _require_listener(address)
    try:
        with warnings.catch_warnings():
            # versions are looked at below, in words that say what to do
            warnings.simplefilter("ignore")
            client = Client(address, timeout=_CONNECTING_S, set_as_default=False)
    except (OSError, ValueError):  # a timeout is an OSError
        raise _no_scheduler(address) from None
    try:
        _require_workers(client, address)
        yield client
    finally:
        client.close(timeout=_CONNECTING_S)


@contextmanager
def _dask_silent() -> Iterator[None]:
    """What goes wrong is told once, in our own words, not by dask's log as well."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    logs = {log: log.level for log in map(logging.getLogger, names)}
    for log in logs:
        log.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for log, level in logs.items():
            log.setLevel(level)


def _require_listener(address: str) -> None:
    """Knock first: a client that finds nobody leaves threads behind."""
    scheme, _, place = address.rpartition("://")
    host, _, port = place.rpartition(":")
    if scheme not in _SCHEMES or not host or not port.isdecimal():
        raise _no_scheduler(address)
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECTING_S).close()
        with ThreadPoolExecutor(1) as beside:  # a notebook has a loop running in this thread
            beside.submit(asyncio.run, _shaken_hands(address)).result()
    except (OSError, OverflowError, UnicodeError) as error:
        raise _no_scheduler(address) from error


async def _shaken_hands(address: str) -> None:
    """Find out whether dask is there: its client would wait for ever for another's answer."""
    from distributed.comm.core import connect

    comm = await asyncio.wait_for(connect(address, timeout=_CONNECTING_S), _CONNECTING_S)
    await comm.close()


def _no_scheduler(address: str) -> InputError:
    return InputError(
        f"no dask scheduler answers at '{address}'",
        "start one with: dask scheduler, and give the address that it prints, as "
        "tcp://127.0.0.1:8786",
    )


def _require_workers(client: Client, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=_CONNECTING_S)
    except TimeoutError as error:
        raise InputError(
            f"the scheduler at {address} has no workers",
            f"start some, on any computer that reaches it: dask worker {address}",
        ) from error
    workers = cast("dict[str, Any]", client.get_versions())["workers"].values()
    theirs = {str(worker["packages"]["distributed"]) for worker in workers if worker}
    own = version("distributed")
    if theirs - {own}:
        raise InputError(
            f"workers have distributed {', '.join(sorted(theirs))}, here it is {own}",
            "install the same version everywhere",
        )


def _parts(
    client: Client, function: Callable[[Item], Result], items: Sequence[Item], what: str
) -> Iterator[list[Result]]:
    threads = sum(cast("dict[str, int]", client.nthreads()).values())
    size = min(max(math.ceil(len(items) / (_CHUNKS_PER_THREAD * threads)), 1), _LARGEST_CHUNK)
    chunks = [list(items[first : first + size]) for first in range(0, len(items), size)]
    futures = [
        client.submit(_made, function, chunk, _versions(), pure=False, retries=_RETRIES)
        for chunk in chunks
    ]
    try:
        for future in futures:
            yield _result(client, future, what)
            future.release()
    finally:
        client.cancel(futures, force=True)


def _result(client: Client, future: Future, what: str) -> Any:
    """A chunk's results, waited for as long as there is a worker to make them."""
    from distributed import KilledWorker

    waited = 0.0
    while True:
        try:
            return _told(future.result(timeout=_LOOK_S))
        except TimeoutError:
            waited = 0.0 if client.nthreads() else waited + _LOOK_S
            if waited >= _PATIENCE_S:
                raise _lost(what) from None
        except KilledWorker as error:
            raise InputError(
                f"{what}: several workers were lost over the same part of the work",
                "give them more memory; then try again",
            ) from error
        except CancelledError as error:  # what dask makes of all work when the scheduler is gone
            raise _lost(what) from error
        except (ImportError, RuntimeError) as error:
            if isinstance(error, RuntimeError) and _UNREADABLE not in str(error):
                raise
            raise InputError(
                f"{what}: the cluster cannot read what it is given",
                "install sheetoflight in the same version for the scheduler and for every worker",
            ) from error


def _lost(what: str) -> InputError:
    return InputError(
        f"{what}: the cluster was lost", "see that scheduler and workers run, then try again"
    )


def _told(answer: list[Any] | str) -> list[Any]:
    if isinstance(answer, str):
        raise InputError(
            f"a worker has {answer}, here it is {_in_words(_versions())}",
            "install the same versions everywhere",
        )
    return answer


def _made(function: Callable[[Any], Any], chunk: list[Any], versions: dict[str, str]) -> Any:
    """On a worker: the results of a chunk, or the versions that forbid to make them."""
    own = _versions()
    if own != versions:
        return _in_words(own)
    with _ONE_AT_A_TIME:
        return [function(item) for item in chunk]


def _versions() -> dict[str, str]:
    python = ".".join(map(str, sys.version_info[:2]))
    return {"Python": python, **{name: version(name) for name in _SAME}}


def _in_words(versions: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in versions.items())
