"""What is no file of frames is refused when it is listed, before it can fill the memory."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames import list_frames, read_frames
from tests.io.frame_files import (
    COLOUR,
    GREY,
    hdf5,
    npy,
    video,
    whys,
)


def npy_header(shape: tuple[int, ...], kind: str = "|u1") -> bytes:
    words = str({"descr": kind, "fortran_order": False, "shape": shape}).ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(words).to_bytes(2, "little") + words.encode()


def claiming_npy(path: Path) -> Path:
    path.write_bytes(npy_header((10, 10**6, 10**6)) + bytes(1000))
    return path


def claiming_hdf5(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("frames", (10, 10**6, 10**6), np.uint8, chunks=(1, 100, 100))
    return path


def claiming_chunks(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("frames", (10**6, 1000, 1000), np.uint8, chunks=(4000, 1000, 1000))
    return path


def claiming_video(path: Path) -> Path:
    video(path, "FFV1", COLOUR)
    data = bytearray(path.read_bytes())
    place = data.index(b"strf") + 12
    data[place : place + 8] = (16000).to_bytes(4, "little") * 2
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("write", "name"),
    [
        (claiming_npy, "a.npy"),
        (claiming_hdf5, "a.h5"),
        (claiming_chunks, "b.h5"),
        (claiming_video, "a.avi"),
    ],
    ids=lambda given: given if isinstance(given, str) else given.__name__,
)
def test_gigantic_claims_are_refused_before_any_room_is_made(
    tmp_path: Path, write: Callable[[Path], Path], name: str
):
    path = write(tmp_path / name)
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=r"(10{6}) × \1|4000000000 bytes|16000 × 16000"):
            list_frames([path])
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()


def test_a_gigantic_page_is_refused_before_any_room_is_made(tmp_path: Path):
    path = tmp_path / "stack.tif"
    with tifffile.TiffWriter(path) as file:
        for picture in GREY[:3]:
            file.write(picture, contiguous=False, metadata=None)
    data = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        for tag in ("ImageWidth", "ImageLength"):
            place = file.pages[1].tags[tag].offset  # type: ignore[union-attr]
            data[place + 2 : place + 12] = b"\4\0\1\0\0\0" + (10**6).to_bytes(4, "little")
    path.write_bytes(data)
    tracemalloc.start()
    try:
        found = list(read_frames(list_frames([path])))
        assert tracemalloc.get_traced_memory()[1] < 2e6
    finally:
        tracemalloc.stop()
    assert list(whys(found)) == [1]
    assert "1000000 × 1000000" in whys(found)[1]


def test_the_limit_of_pixels_holds_for_every_kind(tmp_path: Path):
    paths = [npy(tmp_path, GREY), hdf5(tmp_path, GREY), video(tmp_path / "a.avi", "FFV1", COLOUR)]
    for path in paths:
        with pytest.raises(FileError, match=f"48 × 32 px, more than {48 * 32 - 1}"):
            list_frames([path], max_pixels=48 * 32 - 1)
        assert len(list_frames([path], max_pixels=48 * 32)) == 12


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.npy", b"", "damaged or no .npy"),
        ("a.npy", b"\x93NUMPY\x09\x00 no such version", "damaged or no .npy"),
        ("a.npy", npy_header((3, 4, 5), "<f4") + bytes(240), "float32 samples"),
        ("a.npy", npy_header((3, 4, 5), "|O") + bytes(240), "object samples"),
        ("a.npy", npy_header((3, -4, 5)) + bytes(60), "shape"),
        ("a.npy", npy_header((0, 4, 5)), "shape"),
        ("a.npy", npy_header((2, 3, 40, 50)) + bytes(12000), "shape"),
        ("a.h5", b"no such file", "cannot be read"),
        ("a.avi", b"#EXTM3U\n/etc/hostname\n", "no AVI"),
        ("a.mp4", b"\0\0\0\x18ftypisom and nothing else", "no video"),
    ],
)
def test_a_file_that_holds_no_frames_is_refused(
    tmp_path: Path, name: str, content: bytes, words: str, capfd: pytest.CaptureFixture[str]
):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=words) as refused:
        list_frames([tmp_path / name])
    assert str(tmp_path / name) in str(refused.value)
    assert capfd.readouterr() == ("", "")


def test_fortran_order_is_refused_with_the_way_out(tmp_path: Path):
    path = npy(tmp_path, np.asfortranarray(GREY))
    with pytest.raises(FileError, match="ascontiguousarray"):
        list_frames([path])


@pytest.mark.parametrize("name", ["none.png", "none.npy", "none.h5", "none.avi", "none.tif"])
def test_a_path_that_does_not_exist_is_refused(tmp_path: Path, name: str):
    with pytest.raises(FileError, match=f"{name} does not exist"):
        list_frames([tmp_path / name])


def test_a_folder_with_nothing_to_read_is_refused(tmp_path: Path):
    (tmp_path / "notes.txt").write_text("no picture")
    with pytest.raises(InputError, match="holds no picture, stack or video"):
        list_frames([tmp_path])
