"""Trials made by a real dask cluster on this machine: nothing lost, and the same numbers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from sheetoflight.errors import InputError
from sheetoflight.measurement.method_comparison import ComparisonOptions, MethodComparison
from sheetoflight.workflow.compared import compare
from sheetoflight.workflow.scheduled import spread_on_cluster
from sheetoflight.workflow.spread import Execution

pytest.importorskip("distributed")

OPTIONS = ComparisonOptions(
    methods=("rod-joint", "crossing-two-step", "camera-free"), trials=24, segments=3, seed=11
)
START_S = 30.0

Started = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Started]:
    """Start ``python -m dask``, and end it after the test."""
    running: list[subprocess.Popen[bytes]] = []

    def start(*words: str) -> subprocess.Popen[bytes]:
        log = (tmp_path / f"{len(running)}.log").open("wb")
        with log:
            running.append(
                subprocess.Popen(
                    [sys.executable, "-m", "dask", *words],
                    stdout=log,
                    stderr=log,
                    cwd=tmp_path,
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
                )
            )
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.wait()


@pytest.fixture
def scheduler(started: Started, tmp_path: Path) -> str:
    """The address of a scheduler without workers."""
    log = tmp_path / "0.log"
    started("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    address = ""
    until = time.monotonic() + START_S
    while not address and time.monotonic() < until:
        words = log.read_text().split() if log.exists() else []
        address = next((word for word in words if word.startswith("tcp://127.0.0.1:")), "")
        time.sleep(0.05)
    assert address, log.read_text()
    return address


def worker(started: Started, scheduler: str) -> subprocess.Popen[bytes]:
    """One process with one thread, which nobody restarts."""
    words = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
    return started("worker", scheduler, *words)


def without_times(found: MethodComparison) -> MethodComparison:
    return replace(found, scores=tuple(replace(one, seconds=0.0) for one in found.scores))


def test_a_worker_killed_in_mid_run_loses_nothing_and_changes_no_number(
    started: Started, scheduler: str
) -> None:
    from distributed import Client

    first, second = worker(started, scheduler), worker(started, scheduler)
    with Client(scheduler, set_as_default=False, timeout=START_S) as client:
        client.wait_for_workers(2, timeout=START_S)
    told: list[int] = []

    def kill_one_midway(_: str, done: int, total: int) -> None:
        told.append(done)
        if done == total // 4:
            first.send_signal(signal.SIGKILL)
            first.wait()

    found = compare(OPTIONS, Execution(kill_one_midway), scheduler)
    assert first.returncode == -signal.SIGKILL
    assert second.poll() is None
    assert told == list(range(OPTIONS.trials + 1))
    # a worker's results are text and arrays like any: equal to the last bit
    assert repr(without_times(found)) == repr(without_times(compare(OPTIONS)))


def test_a_scheduler_that_does_not_answer_is_named() -> None:
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:1 –"):
        list(spread_on_cluster("tcp://127.0.0.1:1", abs, [1, 2], "test"))


@pytest.mark.parametrize("address", ["nonsense://x", "not an address", ""])
def test_what_is_no_address_is_named(address: str) -> None:
    with pytest.raises(InputError, match="no dask scheduler answers"):
        list(spread_on_cluster(address, abs, [1, 2], "test"))


def test_a_scheduler_without_workers_is_told(
    scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._CONNECTING_S", 1.0)
    with pytest.raises(InputError, match="has no workers – start some"):
        list(spread_on_cluster(scheduler, abs, [1, 2], "test"))


def test_other_versions_on_a_worker_are_refused(
    started: Started, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker(started, scheduler)
    from sheetoflight.workflow import scheduled

    other = {**scheduled._versions(), "numpy": "1.0"}
    monkeypatch.setattr(scheduled, "_versions", lambda: other)
    with pytest.raises(InputError, match=r"a worker has Python .*, here it is .*numpy 1\.0"):
        list(spread_on_cluster(scheduler, abs, [1, 2], "test"))


def test_an_error_of_the_work_itself_arrives(started: Started, scheduler: str) -> None:
    worker(started, scheduler)
    with pytest.raises(ZeroDivisionError):
        list(spread_on_cluster(scheduler, divided, [1, 0], "test"))


def test_workers_that_are_gone_for_good_are_told(
    started: Started, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._PATIENCE_S", 2.0)
    only = worker(started, scheduler)

    def kill(_: str, done: int, __: int) -> None:
        if done == 1:
            only.kill()

    with pytest.raises(InputError, match="the cluster was lost"):
        list(spread_on_cluster(scheduler, time.sleep, [0.3] * 40, "test", Execution(kill)))


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install sheetoflight\[cluster\]"):
        list(spread_on_cluster("tcp://127.0.0.1:1", abs, [1], "test"))


def divided(number: int) -> float:
    """Fails for 0."""
    return 1.0 / number
