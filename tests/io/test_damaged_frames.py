"""Damage costs the frames that are damaged."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile

from sheetoflight.errors import FileError
from sheetoflight.io.frames import list_frames, read_frame, read_frames
from sheetoflight.io.pictures import write_picture
from tests.io.frame_files import (
    COLOUR,
    GREY,
    GREY_16,
    STACKS,
    blue_green_red,
    cut,
    lit,
    npy,
    number_of,
    numbered,
    tiff,
    tiff_by_pages,
    video,
    whys,
)


def test_a_npy_that_ends_in_a_frame_gives_all_whole_ones_and_one_report(tmp_path: Path):
    path = npy(tmp_path, GREY_16)
    frame_bytes = GREY_16[0].nbytes
    cut(path, path.stat().st_size - 4 * frame_bytes - frame_bytes // 2)
    found = list(read_frames(list_frames([path])))
    for i in range(7):
        np.testing.assert_array_equal(lit(found[i]), GREY_16[i])
    assert list(whys(found)) == [7]
    assert "5 of its 12 frames are missing" in whys(found)[7]


def test_a_tiff_by_pages_that_ends_early_gives_all_whole_ones_and_one_report(tmp_path: Path):
    path = tiff_by_pages(tmp_path, GREY_16)
    with tifffile.TiffFile(path) as file:
        offset = file.pages[7].dataoffsets[0]
    found = list(read_frames(list_frames([cut(path, offset + 10)])))
    for i in range(7):
        np.testing.assert_array_equal(lit(found[i]), GREY_16[i])
    assert whys(found)[7].startswith(f"{path}[7] is cut short")
    assert list(whys(found)) in ([7], [7, 8])


@pytest.mark.parametrize("kind", STACKS)
def test_a_tiff_whose_directories_were_to_follow_gives_all_whole_ones(tmp_path: Path, kind: str):
    stack = STACKS[kind]
    path = tiff(tmp_path, stack)
    with tifffile.TiffFile(path) as file:
        start = file.pages[0].dataoffsets[0]
    found = list(read_frames(list_frames([cut(path, start + 7 * stack[0].nbytes + 10)])))
    for i in range(7):
        np.testing.assert_array_equal(lit(found[i]), blue_green_red(stack)[i])
    assert list(whys(found)) == [7]
    assert "5 of its 12 frames are missing" in whys(found)[7]


def test_a_stack_of_imagej_with_one_directory_is_read(tmp_path: Path):
    """ImageJ writes stacks over 4 GB so: the first page's description tells of the others."""
    path = tmp_path / "stack.tif"
    words = "ImageJ=1.53\nimages=12\nslices=12\n"
    tifffile.imwrite(path, GREY_16[0], description=words, metadata=None, byteorder=">")
    with tifffile.TiffFile(path) as file:
        assert len(file.pages) == 1
        start = file.pages[0].dataoffsets[0]
    head = path.read_bytes()[:start]
    path.write_bytes(head + GREY_16.astype(">u2").tobytes())
    found = [lit(one) for one in read_frames(list_frames([path]))]
    np.testing.assert_array_equal(found, GREY_16)


def test_a_damaged_page_costs_that_page(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    path = tmp_path / "stack.tif"
    with tifffile.TiffWriter(path) as file:
        for picture in GREY:
            file.write(picture, contiguous=False, compression="zlib", metadata=None)
    with tifffile.TiffFile(path) as file:
        offset = file.pages[5].dataoffsets[0]
    data = bytearray(path.read_bytes())
    data[offset : offset + 20] = bytes(20)
    path.write_bytes(data)
    found = list(read_frames(list_frames([path])))
    assert list(whys(found)) == [5]
    np.testing.assert_array_equal(lit(found[11]), GREY[11])
    assert capfd.readouterr() == ("", "")


def test_a_chain_of_pages_that_runs_in_a_circle_is_refused_after_one_round(tmp_path: Path):
    path = tiff_by_pages(tmp_path, GREY)
    with tifffile.TiffFile(path) as file:
        first, last = file.pages[0].offset, file.pages[11]
        assert isinstance(last, tifffile.TiffPage)
        place = last.offset + 2 + 12 * len(last.tags)
    data = bytearray(path.read_bytes())
    data[place : place + 4] = first.to_bytes(4, "big")
    path.write_bytes(data)
    found = list(read_frames(list_frames([path])))
    assert list(whys(found)) == [12]
    assert "breaks off after 12" in whys(found)[12]


def test_thumbnails_are_no_frames(tmp_path: Path):
    path = tmp_path / "stack.tif"
    with tifffile.TiffWriter(path) as file:
        for picture in GREY[:3]:
            file.write(picture, contiguous=False, metadata=None)
            file.write(picture[::4, ::4], contiguous=False, subfiletype=1, metadata=None)
    found = [lit(one) for one in read_frames(list_frames([path]))]
    np.testing.assert_array_equal(found, GREY[:3])


def test_a_damaged_chunk_of_hdf5_costs_its_frames(tmp_path: Path):
    path = tmp_path / "stack.h5"
    with h5py.File(path, "w") as file:
        frames = file.create_dataset(
            "frames", data=GREY, chunks=(1, 32, 48), compression="gzip", fletcher32=True
        )
        place = frames.id.get_chunk_info(5).byte_offset
    data = bytearray(path.read_bytes())
    data[place + 20 : place + 40] = bytes(20)
    path.write_bytes(data)
    found = list(read_frames(list_frames([path])))
    assert list(whys(found)) == [5]
    np.testing.assert_array_equal(lit(found[6]), GREY[6])


def test_a_damaged_picture_in_a_folder_costs_that_picture(tmp_path: Path):
    for i in range(5):
        write_picture(tmp_path / f"{i}.png", GREY[i])
    cut(tmp_path / "2.png", 100)
    found = list(read_frames(list_frames([tmp_path])))
    assert list(whys(found)) == [2]
    assert "2.png is damaged" in whys(found)[2]
    np.testing.assert_array_equal(lit(found[4]), GREY[4])


@pytest.mark.parametrize("name", ["a.avi", "a.mkv"])
def test_a_video_that_ends_early_gives_all_frames_before(tmp_path: Path, name: str):
    pictures = blue_green_red(COLOUR)
    path = video(tmp_path / name, "FFV1", pictures)
    cut(path, path.stat().st_size * 6 // 10)
    found = list(read_frames(list_frames([path])))
    damaged = whys(found)
    whole = min(damaged)
    assert 5 <= whole <= 8
    assert list(damaged) == list(range(whole, len(found)))
    assert len(damaged) <= 2
    assert f"{12 - len(found) + 1} of its 12 frames are missing" in damaged[len(found) - 1]
    np.testing.assert_array_equal([lit(one) for one in found[:whole]], pictures[:whole])


def test_a_damaged_frame_of_a_video_does_not_shift_the_others(tmp_path: Path):
    path = video(tmp_path / "a.avi", "MJPG", [numbered(i) for i in range(12)])
    data = path.read_bytes()
    place = data.index(b"movi")
    for _ in range(6):
        place = data.index(b"00dc", place + 1)
    length = int.from_bytes(data[place + 4 : place + 8], "little")
    path.write_bytes(data[: place + 8] + bytes(length) + data[place + 8 + length :])
    found = list(read_frames(list_frames([path])))
    assert list(whys(found)) == [5]
    others = [*range(5), *range(6, 12)]
    assert [number_of(lit(found[i])) for i in others] == others


def test_a_file_that_vanishes_costs_its_frames(tmp_path: Path):
    np.save(tmp_path / "a.npy", GREY[:2])
    np.save(tmp_path / "b.npy", GREY[:2])
    frames = list_frames([tmp_path])
    (tmp_path / "a.npy").unlink()
    found = list(read_frames(frames))
    assert list(whys(found)) == [0, 1]
    with pytest.raises(FileError, match="does not exist"):
        read_frame(frames[0])
