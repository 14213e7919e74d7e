"""Pictures as the sensor saw them; damaged ones are refused."""

from __future__ import annotations

import io
import re
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames import list_frames
from sheetoflight.io.pictures import (
    PictureFile,
    in_order_of_names,
    list_pictures,
    read_picture,
    write_picture,
)

RNG = np.random.default_rng(2)
GREY = RNG.integers(0, 256, (40, 50), dtype=np.uint8)
COLOUR = RNG.integers(0, 256, (40, 50, 3), dtype=np.uint8)
"""Blue, green, red."""
GREY_16 = RNG.integers(0, 65536, (40, 50), dtype=np.uint16)
COLOUR_16 = RNG.integers(0, 65536, (40, 50, 3), dtype=np.uint16)
TYPES = {"grey": GREY, "colour": COLOUR, "grey 16": GREY_16, "colour 16": COLOUR_16}


def chunk(kind: bytes, content: bytes) -> bytes:
    checksum = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + checksum


def png(picture: np.ndarray, width: int | None = None) -> bytes:
    """PNG after its specification (ISO/IEC 15948), rows without a filter."""
    bits = 8 * picture.itemsize
    kind = 2 if picture.ndim == 3 else 0
    rows = picture[..., ::-1] if picture.ndim == 3 else picture
    packed = b"".join(b"\0" + row.astype(f">u{row.itemsize}").tobytes() for row in rows)
    size = (picture.shape[1] if width is None else width, picture.shape[0])
    header = struct.pack(">IIBBBBB", *size, bits, kind, 0, 0, 0)
    content = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(packed)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + content


def portable_map(picture: np.ndarray) -> bytes:
    """Binary PGM or PPM after its manual page: red, green, blue, high byte first."""
    kind = "P6" if picture.ndim == 3 else "P5"
    rows = picture[..., ::-1] if picture.ndim == 3 else picture
    header = f"{kind}\n{picture.shape[1]} {picture.shape[0]}\n{np.iinfo(picture.dtype).max}\n"
    return header.encode() + rows.astype(f">u{picture.itemsize}").tobytes()


def bitmap(picture: np.ndarray) -> bytes:
    """Uncompressed BMP of 24 bit, its rows from the bottom up, each filled to four bytes."""
    height, width, _ = picture.shape
    fill = b"\0" * (-3 * width % 4)
    rows = b"".join(row.tobytes() + fill for row in picture[::-1])
    header = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 24, 0, len(rows), 0, 0, 0, 0)
    return b"BM" + struct.pack("<IHHI", 54 + len(rows), 0, 0, 54) + header + rows


def encoded(ending: str, picture: np.ndarray, *options: int) -> bytes:
    return cv2.imencode(ending, picture, options)[1].tobytes()


def read(tmp_path: Path, content: bytes, name: str = "picture") -> np.ndarray:
    (tmp_path / name).write_bytes(content)
    return read_picture(tmp_path / name)


@pytest.mark.parametrize("picture", TYPES.values(), ids=TYPES)
def test_png_is_read_after_its_specification(tmp_path: Path, picture: np.ndarray):
    got = read(tmp_path, png(picture))
    assert got.dtype == picture.dtype
    np.testing.assert_array_equal(got, picture)


@pytest.mark.parametrize("picture", TYPES.values(), ids=TYPES)
def test_portable_maps_are_read_after_their_manual(tmp_path: Path, picture: np.ndarray):
    np.testing.assert_array_equal(read(tmp_path, portable_map(picture)), picture)


def test_bitmaps_are_read_after_their_layout(tmp_path: Path):
    picture = COLOUR[:, :49]
    np.testing.assert_array_equal(read(tmp_path, bitmap(picture)), picture)
    with pytest.raises(FileError, match="it is cut short"):
        read(tmp_path, bitmap(picture)[:-1])


@pytest.mark.parametrize(
    "options",
    [{}, {"compression": "zlib"}, {"bigtiff": True}, {"tile": (16, 16)}, {"byteorder": ">"}],
    ids=repr,
)
@pytest.mark.parametrize("picture", TYPES.values(), ids=TYPES)
def test_tiff_is_read(tmp_path: Path, picture: np.ndarray, options: dict[str, Any]):
    colour = picture.ndim == 3
    tifffile.imwrite(
        tmp_path / "picture.tif",
        picture[..., ::-1] if colour else picture,
        photometric="rgb" if colour else "minisblack",
        **options,
    )
    got = read_picture(tmp_path / "picture.tif")
    assert got.dtype == picture.dtype
    np.testing.assert_array_equal(got, picture)


def test_colour_planes_one_after_the_other_are_read(tmp_path: Path):
    planes = np.moveaxis(COLOUR[..., ::-1], -1, 0).copy()
    tifffile.imwrite(tmp_path / "p.tif", planes, photometric="rgb", planarconfig="separate")
    np.testing.assert_array_equal(read_picture(tmp_path / "p.tif"), COLOUR)


@pytest.mark.parametrize("picture", [GREY, GREY_16], ids=["8", "16"])
def test_white_stored_as_zero_comes_as_white(tmp_path: Path, picture: np.ndarray):
    tifffile.imwrite(tmp_path / "p.tif", picture, photometric="miniswhite")
    np.testing.assert_array_equal(
        read_picture(tmp_path / "p.tif"), np.iinfo(picture.dtype).max - picture
    )


def test_tiff_that_only_opencv_unpacks_is_read(tmp_path: Path):
    lzw = 5
    content = encoded(".tif", GREY_16, cv2.IMWRITE_TIFF_COMPRESSION, lzw)
    np.testing.assert_array_equal(read(tmp_path, content), GREY_16)


@pytest.mark.parametrize("number", [8, 32946])
@pytest.mark.parametrize("picture", TYPES.values(), ids=TYPES)
def test_damage_in_a_deflated_tiff_is_found_wherever_it_is(
    tmp_path: Path, picture: np.ndarray, number: int, capfd: pytest.CaptureFixture[str]
):
    """Every strip is a stream of zlib's (RFC 1950), which ends in a checksum of what it holds."""
    content = bytearray(encoded(".tif", picture, cv2.IMWRITE_TIFF_COMPRESSION, number))
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        page = file.pages.first
        assert page.compression == number
        extents = list(zip(page.dataoffsets, page.databytecounts, strict=True))
    np.testing.assert_array_equal(read(tmp_path, bytes(content)), picture)
    capfd.readouterr()
    places = [place for offset, length in extents for place in range(offset, offset + length, 97)]
    for place in [*places, sum(extents[-1]) - 1]:
        content[place] ^= 0x10
        with pytest.raises(FileError, match="picture is damaged"):
            read(tmp_path, bytes(content))
        content[place] ^= 0x10
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("number", [1, 8])
def test_colours_by_a_table_are_read(tmp_path: Path, number: int):
    """Which tifffile leaves to others."""
    table = RNG.integers(0, 256, (3, 256), dtype=np.uint16)
    tifffile.imwrite(
        tmp_path / "p.tif", GREY, photometric="palette", colormap=table * 257, compression=number
    )
    blue_green_red = np.moveaxis(table.astype(np.uint8)[::-1, GREY], 0, -1)
    np.testing.assert_array_equal(read_picture(tmp_path / "p.tif"), blue_green_red)


def test_transparency_is_left_out(tmp_path: Path):
    content = encoded(".png", np.dstack([COLOUR, GREY]))
    np.testing.assert_array_equal(read(tmp_path, content), COLOUR)


def test_a_picture_is_not_turned_by_what_the_file_says(tmp_path: Path):
    """Exif orientation 6 asks viewers to turn the picture by 90°; the lens was not turned."""
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    jpeg = encoded(".jpg", GREY)
    turned = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]
    shown = cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert shown is not None
    assert shown.shape == (50, 40)
    np.testing.assert_array_equal(read(tmp_path, turned), read(tmp_path, jpeg))


@settings(max_examples=25)
@given(
    hnp.arrays(
        st.sampled_from([np.uint8, np.uint16]),
        st.tuples(st.integers(1, 9), st.integers(1, 9))
        | st.tuples(*[st.integers(1, 9)] * 2, st.just(3)),
    )
)
def test_what_is_written_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, picture: np.ndarray
):
    path = tmp_path_factory.getbasetemp() / "round_trip.PNG"
    write_picture(path, picture)
    got = read_picture(path)
    assert got.dtype == picture.dtype
    np.testing.assert_array_equal(got, picture)


@pytest.mark.parametrize(
    "picture",
    [GREY.astype(float), GREY.astype(np.int16), COLOUR[..., :2], np.zeros((0, 4), np.uint8)],
    ids=["float", "signed", "two channels", "nothing"],
)
def test_what_is_no_picture_is_not_written(tmp_path: Path, picture: Any):
    with pytest.raises(InputError, match=r"a picture for .*p.png has shape .* and type"):
        write_picture(tmp_path / "p.png", picture)
    with pytest.raises(InputError, match=r"p.jpg does not end in .png"):
        write_picture(tmp_path / "p.jpg", GREY)
    assert list(tmp_path.iterdir()) == []


ENCODED = {
    "png": png(COLOUR),
    "png 16": png(GREY_16),
    "jpeg": encoded(".jpg", COLOUR),
    "tiff": encoded(".tif", GREY),
    "bmp": bitmap(COLOUR),
    "ppm": portable_map(COLOUR),
    "webp": encoded(".webp", COLOUR),
    "jp2": encoded(".jp2", GREY),
}


@pytest.mark.parametrize("content", ENCODED.values(), ids=ENCODED)
def test_no_part_of_a_picture_passes_for_the_whole(
    tmp_path: Path,
    content: bytes,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
):
    for length in np.linspace(0, 0.95 * len(content), 60).astype(int):
        with pytest.raises(FileError, match=r"picture (is empty|is damaged)"):
            read(tmp_path, content[:length])
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []


@pytest.mark.parametrize("content", ENCODED.values(), ids=ENCODED)
def test_a_picture_that_lost_its_last_bytes_is_refused_or_whole(tmp_path: Path, content: bytes):
    """A TIFF may end in a pointer to a further picture that is not there."""
    whole = read(tmp_path, content)
    for length in range(len(content) - 40, len(content)):
        try:
            got = read(tmp_path, content[:length])
        except FileError:
            continue
        np.testing.assert_array_equal(got, whole)


def test_a_tiff_cut_short_is_refused_before_decoding(tmp_path: Path):
    tifffile.imwrite(tmp_path / "p.tif", GREY, photometric="minisblack")
    content = (tmp_path / "p.tif").read_bytes()
    with pytest.raises(FileError, match="picture is damaged: it is cut short"):
        read(tmp_path, content[:-1])
    with pytest.raises(FileError, match="picture is damaged: its directory makes no sense"):
        read(tmp_path, content[:100])


def test_a_thumbnails_end_is_not_the_pictures(tmp_path: Path):
    jpeg, thumbnail = encoded(".jpg", COLOUR), encoded(".jpg", GREY)
    segment = b"\xff\xe2" + struct.pack(">H", len(thumbnail) + 2) + thumbnail
    with_thumbnail = jpeg[:2] + segment + jpeg[2:]
    assert read(tmp_path, with_thumbnail).shape == COLOUR.shape
    with pytest.raises(FileError, match="its end is missing"):
        read(tmp_path, with_thumbnail[:-2])


def test_one_wrong_bit_in_a_png_is_found_before_decoding(tmp_path: Path):
    content = bytearray(png(GREY))
    for place in range(8, len(content), 101):
        content[place] ^= 1
        with pytest.raises(FileError, match="picture is damaged: "):
            read(tmp_path, bytes(content))
        content[place] ^= 1


def test_a_header_that_claims_too_much_is_refused_before_decoding(tmp_path: Path):
    (tmp_path / "p.png").write_bytes(png(GREY, width=30_000))
    with pytest.raises(FileError, match=r"has 30000 × 40 px, more than 1000000 in all"):
        read_picture(tmp_path / "p.png", max_pixels=1_000_000)
    (tmp_path / "p.ppm").write_bytes(portable_map(GREY))
    with pytest.raises(FileError, match="has 50 × 40 px, more than 1999 in all"):
        read_picture(tmp_path / "p.ppm", max_pixels=1999)
    assert read_picture(tmp_path / "p.ppm", max_pixels=2000).shape == GREY.shape


def test_the_decoder_is_held_to_the_limit_too():
    """Asked of a fresh interpreter: OpenCV reads its limit when it is loaded."""
    program = (
        "from sheetoflight.io import pictures; import cv2, numpy as np\n"
        "claim = b'P5\\n20000 10001\\n255\\n' + b'\\0' * 9\n"
        "try: cv2.imdecode(np.frombuffer(claim, np.uint8), 0)\n"
        "except cv2.error as error: print(error)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert "pixels" in result.stdout + result.stderr


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (GREY.astype(np.float32), r"holds float32 samples in shape \(40, 50\), expected 8 or 16"),
        (np.stack([GREY, GREY]), "holds 2 pictures, expected one"),
    ],
    ids=["float", "several"],
)
def test_tiff_that_is_no_single_picture(tmp_path: Path, picture: np.ndarray, message: str):
    tifffile.imwrite(tmp_path / "p.tif", picture, photometric="minisblack")
    with pytest.raises(FileError, match=f"p.tif {message}"):
        read_picture(tmp_path / "p.tif")


def test_a_tiff_that_claims_a_thousand_channels_is_refused_before_room_is_made(tmp_path: Path):
    tifffile.imwrite(tmp_path / "p.tif", np.zeros((40, 50, 1000), np.uint8), planarconfig="contig")
    with pytest.raises(FileError, match=r"p.tif is damaged: it claims more samples in a pixel"):
        read_picture(tmp_path / "p.tif")


def test_what_is_no_picture(tmp_path: Path):
    with pytest.raises(FileError, match=r"picture is damaged or in a format that cannot be read"):
        read(tmp_path, b"view,stage,marker,u,v\n")
    with pytest.raises(FileError, match=r"missing.png does not exist"):
        read_picture(tmp_path / "missing.png")


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).touch()


def test_a_folder_is_listed_by_name_in_pairs(tmp_path: Path):
    touch(tmp_path, "b.png", "a_on.TIF", "a_off.png", "c_on.jpg", "d_off.bmp", "_on.png")
    touch(tmp_path, ".hidden.png", "notes.txt", "points.csv", "png")
    (tmp_path / "folder.png").mkdir()
    assert list_pictures(tmp_path) == [
        PictureFile("_on", tmp_path / "_on.png"),
        PictureFile("a", tmp_path / "a_off.png", tmp_path / "a_on.TIF"),
        PictureFile("b", tmp_path / "b.png"),
        PictureFile("c", tmp_path / "c_on.jpg"),
        PictureFile("d", tmp_path / "d_off.bmp"),
    ]


def test_numbers_in_names_count_by_their_value(tmp_path: Path):
    touch(tmp_path, *(f"f_{i}x{j}.png" for i in (10, 9, 1) for j in (2, 10)), "f.png")
    names = [file.name for file in list_pictures(tmp_path)]
    assert names == ["f", "f_1x2", "f_1x10", "f_9x2", "f_9x10", "f_10x2", "f_10x10"]
    frames = [frame.name for frame in list_frames([tmp_path])]
    assert frames == names


@given(st.lists(st.text("a0129_", max_size=6), unique=True))
def test_every_name_has_its_place(names: list[str]):
    """Names that differ are never equals, and zeros before a number do not move it."""
    found = sorted(names, key=in_order_of_names)
    assert found == sorted(sorted(names), key=in_order_of_names)
    padded = [re.sub(r"\d+", lambda number: number[0].zfill(8), name) for name in found]
    assert padded == sorted(padded)


@pytest.mark.parametrize(
    "names",
    [("a.png", "a.tif"), ("a_on.png", "a_on.tif"), ("a.png", "a_off.png"), ("a.png", "a_on.png")],
    ids=" ".join,
)
def test_two_pictures_of_one_name_are_refused(tmp_path: Path, names: tuple[str, str]):
    touch(tmp_path, *names)
    with pytest.raises(InputError, match=f"{names[0]} and {names[1]} are pictures of the same"):
        list_pictures(tmp_path)


def test_a_folder_without_pictures_is_named(tmp_path: Path):
    touch(tmp_path, "a.txt", ".b.png")
    with pytest.raises(InputError, match=rf"{tmp_path.name} holds no picture – put pictures there"):
        list_pictures(tmp_path)
    with pytest.raises(FileError, match="missing is no folder that can be read"):
        list_pictures(tmp_path / "missing")
    with pytest.raises(FileError, match=r"a.txt is no folder that can be read"):
        list_pictures(tmp_path / "a.txt")
