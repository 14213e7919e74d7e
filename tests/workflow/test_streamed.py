"""Work on streams: every frame once, in order, whatever is damaged, at constant memory."""

from __future__ import annotations

import os
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest
import tifffile

from sheetoflight.errors import InputError
from sheetoflight.io.frames import DamagedFrame, Frame, list_frames
from sheetoflight.io.pictures import write_picture
from sheetoflight.workflow.spread import Execution, spread
from sheetoflight.workflow.streamed import stream
from tests.io.frame_files import number_of, numbered, video

RNG = np.random.default_rng(12)
STACK = RNG.integers(0, 65536, (40, 20, 30), dtype=np.uint16)


def total(_frame: Frame, on: np.ndarray, off: np.ndarray | None) -> tuple[int, int | None]:
    return int(on.sum()), None if off is None else int(off.sum())


def number(_frame: Frame, on: np.ndarray, _off: np.ndarray | None) -> int:
    return number_of(on)


def total_if_even(_frame: Frame, on: np.ndarray, _off: np.ndarray | None) -> int:
    if on.sum() % 2:
        raise InputError("its sum is odd", "add one")
    return int(on.sum())


def brightest(_frame: Frame, on: np.ndarray, _off: np.ndarray | None) -> int:
    return int(on.max())


def ends_its_process(_frame: Frame, _on: np.ndarray, _off: np.ndarray | None) -> None:
    os._exit(1)


def sleeps(_frame: Frame, _on: np.ndarray, _off: np.ndarray | None) -> None:
    time.sleep(0.05)


@pytest.mark.parametrize("processes", [1, 2])
def test_every_frame_is_worked_on_once_and_in_order(tmp_path: Path, processes: int):
    np.save(tmp_path / "b.npy", STACK)
    tifffile.imwrite(tmp_path / "c.tif", STACK[:5], photometric="minisblack")
    write_picture(tmp_path / "a_off.png", STACK[0])
    write_picture(tmp_path / "a_on.png", STACK[1])
    frames = list_frames([tmp_path])
    told = []
    run = Execution(lambda *words: told.append(words), processes)
    found = list(stream(total, frames, "add up", run))
    assert [frame for frame, _ in found] == list(frames)
    sums = [int(picture.sum()) for picture in STACK]
    expected = [(sums[1], sums[0]), *((one, None) for one in sums + sums[:5])]
    assert [result for _, result in found] == expected
    assert told == [("add up", done, 46) for done in range(47)]


def test_processes_that_share_a_video_agree_on_the_numbers(tmp_path: Path):
    path = video(tmp_path / "a.mp4", "mp4v", [numbered(i) for i in range(90)])
    found = list(stream(number, list_frames([path]), "read", Execution(processes=2)))
    assert [result for _, result in found] == list(range(90))


@pytest.mark.parametrize("processes", [1, 2])
def test_a_damaged_picture_is_reported_and_the_rest_finished(tmp_path: Path, processes: int):
    for i in range(10):
        write_picture(tmp_path / f"{i}.png", STACK[i])
    damaged = tmp_path / "4.png"
    damaged.write_bytes(damaged.read_bytes()[:200])
    found = list(stream(total, list_frames([tmp_path]), "add", Execution(processes=processes)))
    assert [frame.name for frame, _ in found] == [str(i) for i in range(10)]
    for i, (frame, result) in enumerate(found):
        if i == 4:
            assert isinstance(result, DamagedFrame)
            assert result.frame == frame
            assert "4.png is damaged" in result.why
        else:
            assert result == (int(STACK[i].sum()), None)


@pytest.mark.parametrize("processes", [1, 2])
def test_a_frame_that_the_function_refuses_is_a_damaged_one(tmp_path: Path, processes: int):
    np.save(tmp_path / "a.npy", STACK)
    run = Execution(processes=processes)
    found = [result for _, result in stream(total_if_even, list_frames([tmp_path]), "add", run)]
    sums = [int(picture.sum()) for picture in STACK]
    assert 5 < sum(one % 2 for one in sums) < 35
    for one, result in zip(sums, found, strict=True):
        if one % 2:
            assert isinstance(result, DamagedFrame)
            assert result.why == "its sum is odd – add one"
        else:
            assert result == one


def test_no_frames_give_no_results():
    assert list(stream(total, list_frames([]), "add", Execution(processes=2))) == []


def peak_memory(path: Path) -> int:
    frames = list_frames([path])
    tracemalloc.start()
    try:
        assert sum(1 for _ in stream(brightest, frames, "look")) == len(frames)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path: Path):
    picture = RNG.integers(0, 256, (300, 400), dtype=np.uint8)
    for count in (40, 400):
        np.save(tmp_path / f"{count}.npy", np.broadcast_to(picture, (count, 300, 400)))
    few, many = (peak_memory(tmp_path / f"{count}.npy") for count in (40, 400))
    assert few > picture.nbytes
    assert many < few + picture.nbytes // 2


@dataclass
class Counted:
    """Numbers that tell how many of them have been asked for."""

    length: int
    asked: int = 0

    def __len__(self) -> int:
        return self.length

    def __iter__(self) -> Iterator[int]:
        for i in range(self.length):
            self.asked += 1
            yield i


def test_only_so_many_items_are_under_way_as_keep_the_processes_busy():
    items = Counted(200)
    ahead = [
        items.asked - done
        for done, _ in enumerate(spread(abs, items, "turn", Execution(processes=2)), start=1)
    ]
    assert len(ahead) == 200
    assert 2 <= max(ahead) <= 8


def test_a_process_that_is_ended_from_outside_is_told(tmp_path: Path):
    np.save(tmp_path / "a.npy", STACK)
    run = Execution(processes=2)
    with pytest.raises(InputError, match="look: a process that shared the work was ended"):
        list(stream(ends_its_process, list_frames([tmp_path]), "look", run))


def test_whoever_stops_early_leaves_no_process_behind(tmp_path: Path):
    np.save(tmp_path / "a.npy", STACK)
    before = set(active_children())
    results = stream(sleeps, list_frames([tmp_path]), "wait", Execution(processes=2))
    next(results)
    assert set(active_children()) - before
    results.close()  # type: ignore[attr-defined]
    until = time.monotonic() + 10
    while set(active_children()) - before and time.monotonic() < until:
        time.sleep(0.02)
    assert not set(active_children()) - before
