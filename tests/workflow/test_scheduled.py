"""Trials made by a real dask cluster on this machine: nothing lost, and the same numbers."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from sheetoflight.errors import InputError
from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.measurement.method_comparison import MethodComparison
from sheetoflight.workflow.compared import compare
from sheetoflight.workflow.scheduled import spread_on_cluster
from sheetoflight.workflow.spread import Execution

pytest.importorskip("distributed")

OPTIONS = ComparisonOptions(
    methods=("rod-joint", "crossing-two-step", "camera-free"), trials=16, segments=3, seed=11
)
START_S = 30.0


class Cluster:
    """Processes of ``python -m dask``, the scheduler first."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[bytes]] = []
        self.start("scheduler", "--port", "0")
        self.address = self._address()

    def start(self, *words: str) -> subprocess.Popen[bytes]:
        with (self.folder / f"{len(self.processes)}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *words, "--host", "127.0.0.1", "--no-dashboard"],
                stdout=log,
                stderr=log,
                cwd=self.folder,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
            )
        self.processes.append(process)
        return process

    def worker(self) -> subprocess.Popen[bytes]:
        """One process with one thread, which nobody restarts."""
        return self.start("worker", self.address, "--nthreads", "1", "--no-nanny")

    def _address(self) -> str:
        log, until = self.folder / "0.log", time.monotonic() + START_S
        while time.monotonic() < until:
            for word in log.read_text().split():
                if word.startswith("tcp://127.0.0.1:"):
                    return word
            time.sleep(0.05)
        raise AssertionError(log.read_text())


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A scheduler of this test's own, as yet without workers."""
    made = Cluster(tmp_path)
    yield made
    for process in made.processes:
        process.kill()
        process.wait()


def without_times(found: MethodComparison) -> MethodComparison:
    return replace(found, scores=tuple(replace(one, seconds=0.0) for one in found.scores))


def test_a_worker_killed_in_mid_run_loses_nothing_and_changes_no_number(cluster: Cluster) -> None:
    from distributed import Client

    first, second = cluster.worker(), cluster.worker()
    with Client(cluster.address, set_as_default=False, timeout=START_S) as client:
        client.wait_for_workers(2, timeout=START_S)
    told: list[int] = []

    def kill_one_midway(_: str, done: int, total: int) -> None:
        told.append(done)
        if done == total // 4:
            first.send_signal(signal.SIGKILL)
            first.wait()

    found = compare(OPTIONS, Execution(kill_one_midway), cluster.address)
    assert first.returncode == -signal.SIGKILL
    assert second.poll() is None
    assert told == list(range(OPTIONS.trials + 1))
    # a worker's results are text and arrays like any: equal to the last bit
    assert repr(without_times(found)) == repr(without_times(compare(OPTIONS)))


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._CONNECTING_S", 1.0)
    with pytest.raises(InputError, match=r"no dask scheduler answers at 'tcp://127\.0\.0\.1:1' –"):
        list(spread_on_cluster("tcp://127.0.0.1:1", abs, [1, 2], "test"))


def test_another_program_at_the_address_is_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._CONNECTING_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        address = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(InputError, match="no dask scheduler answers"):
            list(spread_on_cluster(address, abs, [1, 2], "test"))


@pytest.mark.parametrize(
    "address", ["nonsense://x:1", "not an address", "", "tcp://127.0.0.1", "127.0.0.1:99999"]
)
def test_what_is_no_address_is_named(address: str) -> None:
    with pytest.raises(InputError, match="no dask scheduler answers"):
        list(spread_on_cluster(address, abs, [1, 2], "test"))


def test_a_scheduler_without_workers_is_told(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._CONNECTING_S", 1.0)
    with pytest.raises(InputError, match="has no workers – start some"):
        list(spread_on_cluster(cluster.address, abs, [1, 2], "test"))


def test_other_versions_on_a_worker_are_refused(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.worker()
    from sheetoflight.workflow import scheduled

    other = {**scheduled._versions(), "numpy": "1.0"}
    monkeypatch.setattr(scheduled, "_versions", lambda: other)
    with pytest.raises(InputError, match=r"a worker has Python .*, here it is .*numpy 1\.0"):
        list(spread_on_cluster(cluster.address, abs, [1, 2], "test"))


def test_an_error_of_the_work_itself_arrives(cluster: Cluster) -> None:
    cluster.worker()
    with pytest.raises(ValueError, match="math domain error"):
        list(spread_on_cluster(cluster.address, math.sqrt, [4.0, -1.0], "test"))


def test_what_the_cluster_does_not_have_is_refused(cluster: Cluster) -> None:
    cluster.worker()
    with pytest.raises(InputError, match="cannot read what it is given – install sheetoflight"):
        list(spread_on_cluster(cluster.address, divided, [1, 2], "test"))


def test_a_scheduler_that_dies_is_told(cluster: Cluster, capfd: pytest.CaptureFixture[str]) -> None:
    cluster.worker()

    def kill(_: str, done: int, __: int) -> None:
        if done == 1:
            cluster.processes[0].kill()

    with pytest.raises(InputError, match="the cluster was lost"):
        list(spread_on_cluster(cluster.address, time.sleep, [0.1] * 40, "test", Execution(kill)))
    assert capfd.readouterr().err == ""


def test_workers_that_are_gone_for_good_are_told(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sheetoflight.workflow.scheduled._PATIENCE_S", 2.0)
    only = cluster.worker()

    def kill(_: str, done: int, __: int) -> None:
        if done == 1:
            only.kill()

    with pytest.raises(InputError, match="the cluster was lost"):
        list(spread_on_cluster(cluster.address, time.sleep, [0.3] * 40, "test", Execution(kill)))


def test_without_dask_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install sheetoflight\[cluster\]"):
        list(spread_on_cluster("tcp://127.0.0.1:1", abs, [1], "test"))


def divided(number: int) -> float:
    """Fails for 0."""
    return 1.0 / number
