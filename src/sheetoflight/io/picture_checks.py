"""What a picture file says of itself, read before it is decoded.

A decoder may give back a picture whose lower part is grey where the file was cut short, and it
makes room for as many pixels as the header claims. So the claims are read here first.
"""

from __future__ import annotations

import io
import logging
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import tifffile

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_JPEG_SIZES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_JPEG_SCAN, _JPEG_END = 0xDA, b"\xff\xd9"

_MOST_BYTES_PER_PIXEL = 32
"""Four channels of eight bytes: the most that any picture has."""


class DamagedPictureError(Exception):
    """The file contradicts itself; the message says how."""


@dataclass(frozen=True)
class Claims:
    """Width, height and number of pictures that a file's header states."""

    width: int
    height: int
    pictures: int = 1


def is_tiff(data: bytes) -> bool:
    """Whether the file begins as TIFF or BigTIFF does."""
    return data.startswith(_TIFF)


@contextmanager
def silent(logger_name: str) -> Iterator[None]:
    """A library's words on damaged files kept from standard error: they name no file."""
    logger = logging.getLogger(logger_name)
    was_disabled, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = was_disabled


@contextmanager
def tiff_page(data: bytes) -> Iterator[tuple[tifffile.TiffPage, int]]:
    """The first page of a TIFF, and how many there are, thumbnails left out.

    What tifffile logs of a damaged file is kept from standard error.
    """
    with silent("tifffile"), tifffile.TiffFile(io.BytesIO(data)) as file:
        pages = [
            page
            for page in file.pages
            if isinstance(page, tifffile.TiffPage) and not page.is_reduced
        ]
        yield pages[0], len(pages)


def claims(data: bytes) -> Claims | None:
    """What the header states, after a check that the file is whole.

    PNG by its checksums, JPEG by its end marker, TIFF by where its strips lie, BMP by its size.

    Returns
    -------
    Claims or None
        None for formats that only the decoder knows.

    Raises
    ------
    DamagedPictureError
        If the file is cut short or its header makes no sense. Damage inside the compressed
        data of a JPEG leaves no trace that could be found: the format has no checksum.
    """
    try:
        if data.startswith(_PNG):
            return _png(data)
        if data.startswith(_JPEG):
            return _jpeg(data)
        if data.startswith(b"BM"):
            return _bmp(data)
        return _tiff(data) if is_tiff(data) else None
    except (struct.error, IndexError) as error:
        raise DamagedPictureError("it is cut short") from error


def _png(data: bytes) -> Claims:
    """Every chunk is length, type, content, checksum; IHDR comes first and IEND last."""
    place, kind = len(_PNG), b""
    while kind != b"IEND":
        (length,) = struct.unpack_from(">I", data, place)
        kind = data[place + 4 : place + 8]
        (checksum,) = struct.unpack_from(">I", data, place + 8 + length)
        if zlib.crc32(memoryview(data)[place + 4 : place + 8 + length]) != checksum:
            raise DamagedPictureError("a checksum does not agree with the content")
        place += 12 + length
    return Claims(*struct.unpack_from(">II", data, 16))


def _jpeg(data: bytes) -> Claims:
    """Segments up to the first scan; a thumbnail's end marker lies before it."""
    place, size = 2, None
    while True:
        if data[place] != 0xFF:
            raise DamagedPictureError("a marker is missing where one must be")
        marker = data[place + 1]
        if marker == 0xFF:
            place += 1
            continue
        if marker in _JPEG_SIZES:
            height, width = struct.unpack_from(">HH", data, place + 5)
            size = Claims(width, height)
        if marker == _JPEG_SCAN:
            break
        (length,) = struct.unpack_from(">H", data, place + 2)
        place += 2 + length
    if data.find(_JPEG_END, place) < 0:
        raise DamagedPictureError("its end is missing")
    if size is None:
        raise DamagedPictureError("its size is missing")
    return size


def _bmp(data: bytes) -> Claims:
    offset, header, width, height = struct.unpack_from("<IIii", data, 10)
    if header < 40:
        raise DamagedPictureError("its header is of a kind that is not read")
    bits, compression = struct.unpack_from("<HI", data, 28)
    if compression in (0, 3):
        row = (abs(width) * bits + 31) // 32 * 4
        if len(data) < offset + row * abs(height):
            raise DamagedPictureError("it is cut short")
    return Claims(abs(width), abs(height))


def _tiff(data: bytes) -> Claims:
    try:
        with tiff_page(data) as (page, count):
            found = Claims(int(page.imagewidth), int(page.imagelength), count)
            fault = fault_of(page, len(data))
    except Exception as error:  # of a damaged file tifffile lets out errors of any type
        raise DamagedPictureError("its directory makes no sense") from error
    if fault:
        raise DamagedPictureError(f"it {fault}")
    return found


def fault_of(page: tifffile.TiffPage, size: int) -> str:
    """What is wrong with a page's claims in a TIFF of so many bytes; empty where nothing is."""
    offsets, lengths = page.dataoffsets, page.databytecounts
    extents = zip(offsets, lengths, strict=False)
    if len(offsets) != len(lengths) or not all(0 < n <= size - place for place, n in extents):
        return "is cut short"
    if page.nbytes > _MOST_BYTES_PER_PIXEL * page.imagewidth * page.imagelength:
        return "claims more samples in a pixel than a picture has"
    return ""
