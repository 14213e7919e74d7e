"""Scans of a laser line beside the fastest way to read the same frames once.

The measure is a whole frame's maximum by vector instructions: it does nothing but read. Frames
are drawn with a wavy line, in a stack far larger than the cache. In turn, the maximum and each
detector go through the whole stack, in one thread and in two (each takes every second frame), and
the share is the median over the rounds of the maximum's time over the detector's. So another job
on the machine slows both alike. Also prints the time of the first call, with compiling and with
the compiled code on disk. Run with ``python -m bench.stripe_speed [--quick]``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from sheetoflight.imaging.stripe.scan.scanner import Detector, Frame, Scan, ScanOptions, scan

SEED = 3
WIDTH, HEIGHT = 2048, 1088
Along = Literal["columns", "rows"]
FIRST_CALL = """
import time, numpy as np
from sheetoflight.imaging.stripe.scan.scanner import ScanOptions, scan
begin = time.perf_counter()
scan(np.zeros((64, 64), np.uint8), ScanOptions(detector={detector!r}))
print(time.perf_counter() - begin)
"""


@njit(nogil=True)
def greatest(samples: NDArray) -> int:
    """Maximum of contiguous samples; LLVM makes vector instructions of it.

    By index: of a loop over the samples themselves it does so for 8 bit alone.
    """
    found = samples[0]
    for k in range(len(samples)):
        found = max(found, samples[k])
    return found


def frames(
    count: int, along: Along = "columns", bits: int = 8, line_width: float = 1.5, seed: int = SEED
) -> Frame:
    """Stack ``(count, H, W)`` with a wavy line of height 120 in noise of 3 on a level of 20."""
    rng = np.random.default_rng(seed)
    length, across = (WIDTH, HEIGHT) if along == "columns" else (HEIGHT, WIDTH)
    dark = rng.normal(20.0, 3.0, (across, length)).astype(np.float32)
    scale = 1 if bits == 8 else 16
    shape = (count, across, length) if along == "columns" else (count, length, across)
    stack: Frame = np.empty(shape, np.uint8) if bits == 8 else np.empty(shape, np.uint16)
    x, offsets = np.arange(length), np.arange(-12, 13)[:, None]
    for n in range(count):
        centre = 0.4 * across + 100.0 * np.sin(x / 300.0 + 0.1 * n) + n % 50
        row = np.rint(centre).astype(int) + offsets
        frame = np.roll(dark, 7 * n, axis=0)
        frame[row, x] += 120.0 * np.exp(-0.5 * ((row - centre) / line_width) ** 2)
        grey = np.rint(scale * np.clip(frame, 0.0, 255.0))
        stack[n] = grey if along == "columns" else grey.T
    return stack


def passed(
    stack: Frame,
    step: Callable[[Frame], object],
    threads: int,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Seconds in which the threads go through the stack."""

    def part(first: int) -> None:
        for frame in stack[first::threads]:
            step(frame)

    with ThreadPoolExecutor(threads) as pool:
        begin = clock()
        list(pool.map(part, range(threads)))
        return clock() - begin


def shares(
    stack: Frame,
    along: Along,
    threads: int = 2,
    rounds: int = 5,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Speed of each detector as a share of the maximum's, median over the rounds.

    With ``time.process_time`` as the clock, other jobs on the machine hardly count: it stands
    while a thread waits for a core.
    """
    steps = {name: _step(name, along) for name in get_args(Detector)}
    for step in (_read, *steps.values()):
        step(stack[0])
    ratios: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(rounds):
        for name, step in steps.items():
            read = passed(stack, _read, threads, clock)
            ratios[name].append(read / passed(stack, step, threads, clock))
    return {name: float(np.median(values)) for name, values in ratios.items()}


def reads(stack: Frame, threads: int, rounds: int) -> tuple[float, float]:
    """Frames a second of the maximum here and of NumPy's, in turn; medians."""
    rates = [
        [len(stack) / passed(stack, step, threads) for step in (_read, np.max)]
        for _ in range(rounds)
    ]
    ours, theirs = np.median(rates, axis=0)
    return float(ours), float(theirs)


def _read(frame: Frame) -> int:
    return greatest(frame.reshape(-1))


def _step(detector: Detector, along: Along) -> Callable[[Frame], Scan]:
    options = ScanOptions(detector=detector, along=along)
    return lambda frame: scan(frame, options)


def first_calls(detector: Detector) -> tuple[float, float]:
    """Seconds of a process's first scan: with nothing compiled before, and with all on disk."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-c", FIRST_CALL.format(detector=detector)]
        cold, cached = (
            float(subprocess.run(command, env=environment, capture_output=True, check=True).stdout)
            for _ in range(2)
        )
    return cold, cached


def main() -> None:
    """Print the tables."""
    quick = "--quick" in sys.argv
    count, rounds = (20, 3) if quick else (110, 7)
    console = Console(width=110)
    table = Table(title=f"{WIDTH} x {HEIGHT}, {count} frames: share of the speed of a maximum, %")
    names = get_args(Detector)
    for heading in ("along", "bit", "threads", "maximum, frames/s", "NumPy's max", *names):
        table.add_column(heading, justify="right")
    for along in get_args(Along):
        for bits in (8, 16):
            stack = frames(count, along, bits)
            for threads in (2, 1):
                found = shares(stack, along, threads, rounds)
                ours, theirs = reads(stack, threads, rounds)
                cells = (along, bits, threads, f"{ours:.0f}", f"{theirs:.0f}")
                values = (f"{100.0 * found[name]:.1f}" for name in names)
                table.add_row(*map(str, cells), *values)
            del stack
    console.print(table)
    table = Table(title="First scan of a process, s")
    for heading in ("detector", "nothing compiled", "compiled code on disk"):
        table.add_column(heading, justify="right")
    for name in names[-2:] if quick else names:
        table.add_row(name, *(f"{seconds:.1f}" for seconds in first_calls(name)))
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
