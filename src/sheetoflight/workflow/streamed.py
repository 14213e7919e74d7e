"""Work on every frame of a stream, spread over the cores, at constant memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TypeVar

from sheetoflight.errors import SheetOfLightError
from sheetoflight.io.frames import DamagedFrame, Frame, read_frames
from sheetoflight.io.pictures import Picture
from sheetoflight.workflow.spread import ALONE, Execution, spread, tell_nobody

Result = TypeVar("Result")
FrameFunction = Callable[[Frame, Picture, Picture | None], Result]
"""Called with the frame, its picture with the laser on, and off where there is one."""

_LONGEST_BLOCK = 16
_BLOCKS_A_PROCESS = 4
_WORTH_A_PROCESS = 8


def stream(
    function: FrameFunction[Result],
    frames: Sequence[Frame],
    what: str,
    run: Execution = ALONE,
) -> Iterator[tuple[Frame, Result | DamagedFrame]]:
    """Results of ``function(frame, on, off)`` for every frame, in their order.

    A frame that cannot be read, or that the function refuses, does not stop the others. Frames
    go to the processes in blocks, whose files are opened once; only a few blocks are under way,
    so that memory does not grow with the number of frames.

    Parameters
    ----------
    function : callable
        Importable by name, so that another process can run it. A `SheetOfLightError` that it
        raises makes this frame a damaged one.
    frames : sequence of Frame
    what : str
        What to call the work when its progress is told, frame by frame.
    run : Execution

    Yields
    ------
    frame : Frame
    result : Result or DamagedFrame

    Raises
    ------
    InputError
        If a process that shares the work is ended from outside.
    """
    run.progress(what, 0, len(frames))
    results = zip(frames, _results(function, frames, what, run), strict=True)
    for done, result in enumerate(results, start=1):
        yield result
        run.progress(what, done, len(frames))


def _results(
    function: FrameFunction[Result], frames: Sequence[Frame], what: str, run: Execution
) -> Iterator[Result | DamagedFrame]:
    if run.processes < 2 or len(frames) < _WORTH_A_PROCESS:
        return _worked(function, frames)
    longest = max(len(frames) // (run.processes * _BLOCKS_A_PROCESS), 1)
    blocks = _Blocks(frames, min(longest, _LONGEST_BLOCK))
    quiet = replace(run, progress=tell_nobody)
    return chain.from_iterable(spread(partial(_block, function), blocks, what, quiet))


def _block(function: FrameFunction[Result], frames: Sequence[Frame]) -> list[Result | DamagedFrame]:
    return list(_worked(function, frames))


def _worked(
    function: FrameFunction[Result], frames: Sequence[Frame]
) -> Iterator[Result | DamagedFrame]:
    for frame, found in zip(frames, read_frames(frames), strict=True):
        yield found if isinstance(found, DamagedFrame) else _of_frame(function, frame, *found)


def _of_frame(
    function: FrameFunction[Result], frame: Frame, on: Picture, off: Picture | None
) -> Result | DamagedFrame:
    try:
        return function(frame, on, off)
    except SheetOfLightError as error:
        return DamagedFrame(frame, str(error))


@dataclass(frozen=True)
class _Blocks:
    """Frames in blocks of consecutive ones, made when they are asked for."""

    frames: Sequence[Frame]
    length: int

    def __len__(self) -> int:
        return math.ceil(len(self.frames) / self.length)

    def __iter__(self) -> Iterator[tuple[Frame, ...]]:
        for start in range(0, len(self.frames), self.length):
            yield tuple(self.frames[start : start + self.length])
