"""Whatever is done to another tool's file, a reader gives a camera or one line that names it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from sheetoflight.errors import SheetOfLightError
from sheetoflight.io.exchange import (
    EXCHANGE_FORMATS,
    Exchanged,
    read_bouguet_corners,
    read_exchange,
    write_exchange,
)
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane

SOURCE = Exchanged(
    camera=Camera((640, 480), 801.5, 803.25, 321.5, 239.75, 0.0, (-0.1, 0.02, 1e-4, -2e-4, 0.0)),
    light_planes=(LightPlane(np.array([0.6, 0.0, 0.8]), 560.0),),
    format="none",
)
WRITTEN = {
    "opencv.yml": "opencv",
    "opencv.xml": "opencv",
    "opencv.json": "opencv",
    "ros.yaml": "ros",
    "kalibr.yaml": "kalibr",
    "halcon.dat": "halcon",
    "bouguet.mat": "bouguet",
}
NAMES = (*WRITTEN, "corners.mat", "compressed.mat")
EXAMPLES = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    for name, to in WRITTEN.items():
        write_exchange(folder / name, SOURCE, to)
    points = np.arange(36.0).reshape(3, 12)
    corners = {"x_1": points[:2], "X_1": points, "active_images": np.ones((1, 1))}
    savemat(folder / "corners.mat", corners)
    savemat(folder / "compressed.mat", corners, do_compression=True)
    return {name: (folder / name).read_bytes() for name in NAMES}


def reader(name: str) -> Callable[[Path], object]:
    corners = name in ("corners.mat", "compressed.mat")
    return read_bouguet_corners if corners else read_exchange


def read_damaged(name: str, data: bytes, folder: Path) -> None:
    path = folder / f"damaged_{name}"
    path.write_bytes(data)
    error = said_of(lambda: reader(name)(path))
    if error is not None:
        assert error.what.startswith(str(path))
        assert error.what.count(str(path)) == 1
        assert error.remedy
        assert "\n" not in str(error)


def said_of(read: Callable[[], object]) -> SheetOfLightError | None:
    """The package's own error, if there is one; any other ends the test."""
    try:
        read()
    except SheetOfLightError as error:
        return error
    return None


def test_all_formats_are_damaged_here():
    assert set(WRITTEN.values()) == set(EXCHANGE_FORMATS)


@pytest.mark.parametrize("name", NAMES)
def test_the_good_files_are_read(name: str, good: dict[str, bytes], tmp_path: Path):
    path = tmp_path / name
    path.write_bytes(good[name])
    found = reader(name)(path)
    if name in WRITTEN:
        assert isinstance(found, Exchanged)
        assert found.format == WRITTEN[name]


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(st.data())
def test_cut_short(name: str, good: dict[str, bytes], tmp_path: Path, data: st.DataObject):
    length = data.draw(st.integers(0, len(good[name]) - 1))
    read_damaged(name, good[name][:length], tmp_path)


@pytest.mark.parametrize("name", NAMES)
@EXAMPLES
@given(st.data())
def test_bytes_changed(name: str, good: dict[str, bytes], tmp_path: Path, data: st.DataObject):
    content = bytearray(good[name])
    places = st.tuples(st.integers(0, len(content) - 1), st.integers(0, 255))
    for place, value in data.draw(st.lists(places, min_size=1, max_size=6)):
        content[place] = value
    read_damaged(name, bytes(content), tmp_path)


NUMBERS = (b"-1", b"0", b"nan", b"1e308", b"-1e-320", b"1e400", b"9" * 400, b"true", b"[]", b"~")


@pytest.mark.parametrize("name", [name for name in WRITTEN if not name.endswith("mat")])
@EXAMPLES
@given(st.data())
def test_numbers_changed(name: str, good: dict[str, bytes], tmp_path: Path, data: st.DataObject):
    """Each of the file's words in turn gives way to a number that no camera has."""
    words = good[name].split(b" ")
    words[data.draw(st.integers(0, len(words) - 1))] = data.draw(st.sampled_from(NUMBERS))
    read_damaged(name, b" ".join(words), tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "a: " * 50_000,
        "{" * 100_000,
        "K: &a [1, 2]\n" + "".join(f"b{i}: &b{i} [*a, *a]\n" for i in range(50)),
        "!!python/object/apply:os.system [ls]",
        "<a>" * 50_000,
        "Focus" + " 1" * 50_000,
        "[" + "1," * 50_000,
        "? [1, 2]\n: 3",
        "K: !!int ''\nD: !!timestamp 2020-99-99",
        "%YAML:1.0\n---\n",
        "\ufeff",
        "'",
    ],
    ids=range(13),
)
def test_texts_that_are_traps(text: str, tmp_path: Path):
    path = tmp_path / "trap.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SheetOfLightError, match=r"trap\.yaml"):
        read_exchange(path)


def test_doubling_references_are_counted_and_not_followed(tmp_path: Path):
    """Fifty lists, each of the one before twice, would be 2⁵⁰ numbers."""
    path = tmp_path / "trap.yaml"
    lists = "".join(f"b{i + 1}: &b{i + 1} [*b{i}, *b{i}]\n" for i in range(50))
    path.write_text(f"b0: &b0 [1, 1]\n{lists}K: *b50\nD: [0, 0, 0, 0]\n")
    with pytest.raises(SheetOfLightError, match="more than 1000 numbers"):
        read_exchange(path, image_size=(640, 480))
