"""Frames of every kind of file come as they were written, in the order they were named."""

from __future__ import annotations

import pickle
import subprocess
import sys
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames import DamagedFrame, Frame, list_frames, read_frame, read_frames
from sheetoflight.io.pictures import write_picture
from tests.io.frame_files import (
    COLOUR,
    GREY,
    GREY_16,
    RNG,
    STACKS,
    WRITERS,
    Writer,
    blue_green_red,
    lit,
    npy,
    number_of,
    numbered,
    video,
)


@pytest.mark.parametrize("kind", STACKS)
@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_stack_gives_the_pictures_that_were_written(tmp_path: Path, write: Writer, kind: str):
    stack = STACKS[kind]
    path = write(tmp_path, stack)
    frames = list_frames([path])
    assert [frame.name for frame in frames] == [f"{path.name}[{i}]" for i in range(12)]
    for found, written in zip(read_frames(frames), blue_green_red(stack), strict=True):
        picture = lit(found)
        assert picture.dtype == written.dtype
        assert picture.dtype.isnative
        np.testing.assert_array_equal(picture, written)
    np.testing.assert_array_equal(lit(read_frame(frames[7])), blue_green_red(stack)[7])


@pytest.mark.parametrize(
    ("name", "code"), [("a.avi", "FFV1"), ("a.mkv", "FFV1"), ("a.avi", "HFYU")]
)
def test_a_lossless_video_gives_the_pictures_that_were_written(
    tmp_path: Path, name: str, code: str
):
    pictures = blue_green_red(COLOUR)
    frames = list_frames([video(tmp_path / name, code, pictures)])
    assert len(frames) == 12
    for order in (range(12), (7, 8, 3, 3, 11, 0)):
        found = [lit(one) for one in read_frames(frames[i] for i in order)]
        np.testing.assert_array_equal(found, pictures[list(order)])


@pytest.mark.parametrize("name", ["a.mp4", "a.mov", "a.mkv", "a.avi"])
def test_the_number_of_a_frame_is_exact_where_most_frames_are_differences(
    tmp_path: Path, name: str
):
    frames = list_frames([video(tmp_path / name, "mp4v", [numbered(i) for i in range(100)])])
    order = [*range(100), 60, 61, 99, 5, 50]
    found = [number_of(lit(one)) for one in read_frames(frames[i] for i in order)]
    assert found == order


@pytest.mark.parametrize("shape", [(32, 48), (32, 48, 3)])
def test_an_array_without_an_axis_of_frames_is_one_picture(tmp_path: Path, shape: tuple[int, ...]):
    picture = RNG.integers(0, 256, shape, dtype=np.uint8)
    np.save(tmp_path / "one.npy", picture)
    (frame,) = list_frames([tmp_path / "one.npy"])
    assert (frame.name, frame.index) == ("one.npy", None)
    expected = picture if picture.ndim == 2 else picture[..., ::-1]
    np.testing.assert_array_equal(lit(read_frame(frame)), expected)


def test_a_data_set_of_an_hdf5_file_is_named(tmp_path: Path):
    path = tmp_path / "two.h5"
    with h5py.File(path, "w") as file:
        file["left/frames"], file["right/frames"] = GREY, GREY_16
    with pytest.raises(InputError, match=r"/left/frames /right/frames – .*two\.h5:/left/frames"):
        list_frames([path])
    frames = list_frames([f"{path}:/right/frames"])
    assert frames[3].name == "two.h5:/right/frames[3]"
    np.testing.assert_array_equal(lit(read_frame(frames[3])), GREY_16[3])
    with pytest.raises(FileError, match="holds no data set /middle"):
        list_frames([f"{path}:/middle"])


# --- Lists ----------------------------------------------------------------------------------------


def test_paths_keep_their_order_and_a_folder_stands_for_all_in_it(tmp_path: Path):
    folder = tmp_path / "folder"
    folder.mkdir()
    for name in ("b", "a_off", "a_on", ".hidden"):
        write_picture(folder / f"{name}.png", GREY[0])
    npy(folder, GREY[:2])
    (folder / "notes.txt").write_text("no picture")
    write_picture(tmp_path / "z.png", GREY[1])
    tifffile.imwrite(tmp_path / "y.tif", GREY[:2], photometric="minisblack")
    frames = list_frames([tmp_path / "z.png", folder, tmp_path / "y.tif"])
    expected = ["z", "a", "b", "stack.npy[0]", "stack.npy[1]", "y.tif[0]", "y.tif[1]"]
    assert [frame.name for frame in frames] == expected
    assert frames[1] == Frame("a", folder / "a_on.png", None, folder / "a_off.png")
    assert frames[2] == Frame("b", folder / "b.png")


def test_pairs_are_joined_where_they_are_named_singly(tmp_path: Path):
    paths = [tmp_path / f"{name}.png" for name in ("b_on", "a", "b_off")]
    for path, picture in zip(paths, GREY, strict=False):
        write_picture(path, picture)
    frames = list_frames(paths)
    assert [frame.name for frame in frames] == ["b", "a"]
    on, off = read_frame(frames[0])
    np.testing.assert_array_equal(on, GREY[0])
    np.testing.assert_array_equal(off, GREY[2])


def test_stacks_are_pairs_too(tmp_path: Path):
    np.save(tmp_path / "run_on.npy", GREY)
    np.save(tmp_path / "run_off.npy", GREY[::-1])
    frames = list_frames([tmp_path])
    assert [frame.name for frame in frames] == [f"run.npy[{i}]" for i in range(12)]
    for i, found in enumerate(read_frames(frames)):
        assert not isinstance(found, DamagedFrame)
        np.testing.assert_array_equal(found[0], GREY[i])
        np.testing.assert_array_equal(found[1], GREY[11 - i])
    np.save(tmp_path / "run_off.npy", GREY[:7])
    with pytest.raises(InputError, match=r"12 frames, its partner .* 7"):
        list_frames([tmp_path])


def test_names_are_unique_even_where_files_are_not(tmp_path: Path):
    for day in ("monday", "tuesday"):
        (tmp_path / day).mkdir()
        npy(tmp_path / day, GREY[:1])
        write_picture(tmp_path / day / "a.png", GREY[0])
    frames = list_frames([tmp_path / "monday", tmp_path / "tuesday"])
    assert len({frame.name for frame in frames}) == 4
    assert frames[2].name == str(tmp_path / "tuesday" / "a")


def test_a_picture_named_again_is_listed_once(tmp_path: Path):
    write_picture(tmp_path / "a.png", GREY[0])
    assert len(list_frames([tmp_path, tmp_path / "a.png", str(tmp_path)])) == 1


def test_a_part_of_a_list_is_a_list_of_the_same_frames(tmp_path: Path):
    np.save(tmp_path / "a.npy", GREY)
    write_picture(tmp_path / "b.png", GREY[0])
    np.save(tmp_path / "c.npy", GREY[:2])
    frames = list_frames([tmp_path])
    names = [frame.name for frame in frames]
    assert len(frames) == len(names) == 15
    for part in (slice(10, 14), slice(None, None, -2), slice(-3, None)):
        assert [frame.name for frame in frames[part]] == names[part]
    assert frames[-1].name == "c.npy[1]"
    with pytest.raises(IndexError):
        frames[15]


def test_a_million_frames_take_no_room(tmp_path: Path):
    with h5py.File(tmp_path / "long.h5", "w") as file:
        file.create_dataset("frames", (10**6, 480, 640), np.uint8, chunks=(1, 480, 640))
    tracemalloc.start()
    try:
        frames = list_frames([tmp_path / "long.h5"])
        assert len(frames) == 10**6
        assert frames[999_999].name == "long.h5[999999]"
        assert tracemalloc.get_traced_memory()[1] < 3e6
    finally:
        tracemalloc.stop()
    assert len(pickle.dumps(frames[999_999])) < 1000


def test_hdf5_is_loaded_where_such_a_file_is_read_and_not_before():
    words = "import sys, sheetoflight.io.frames; print('h5py' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", words], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "False"
