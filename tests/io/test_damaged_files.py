"""Whatever is done to a file, a reader gives back a value or one line that names the file."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sheetoflight.errors import SheetOfLightError
from sheetoflight.io.calibration_json import calibration_text, read_calibration
from sheetoflight.io.pictures import read_picture
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.io.rig_toml import read_rig_toml, rig_toml_text
from sheetoflight.io.segments_csv import read_segments
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

Reader = Callable[[Path], object]
LASERS = ("left", "right")
READERS: dict[str, Reader] = {
    "points.csv": lambda path: read_points(path, CollinearTarget()),
    "two_lasers.csv": lambda path: read_points(path, CollinearTarget(), LASERS),
    "segments.csv": read_segments,
    "rig.toml": lambda path: read_rig_toml(path).rig(),
    "warm_rig.toml": lambda path: read_rig_toml(path).rig(),
    "calibration.json": read_calibration,
    "explained.json": read_calibration,
    "picture.png": read_picture,
    "picture.jpg": read_picture,
    "picture.bmp": read_picture,
    "picture.tif": read_picture,
    "deflated.tif": read_picture,
    "picture.ppm": read_picture,
    "picture.webp": read_picture,
    "picture.jp2": read_picture,
}

SMALL = np.random.default_rng(4).integers(0, 256, (40, 44, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def good(
    tmp_path_factory: pytest.TempPathFactory,
    observations: Observations,
    two_lasers: Observations,
    calibration: Calibration,
    explained: Calibration,
) -> dict[str, bytes]:
    """A good file for every reader."""
    folder = tmp_path_factory.mktemp("good")
    write_points(folder / "points.csv", observations)
    write_points(folder / "two_lasers.csv", two_lasers, LASERS)
    steel = CollinearTarget(expansion_per_K=11.5e-6, warmer_by_K=-4.0, warmer_by_std_K=0.5)
    warm = Rig(steel, (1392, 1040), placement_std=0.3, lasers=LASERS)
    deflated = io.BytesIO()
    tifffile.imwrite(deflated, SMALL, photometric="rgb", compression="zlib")
    files = {
        "points.csv": (folder / "points.csv").read_bytes(),
        "two_lasers.csv": (folder / "two_lasers.csv").read_bytes(),
        "segments.csv": b"segment,u1,v1,u2,v2,std,laser,known_mm,known_std_mm\n"
        b"a,1,2,3,4,0.1,left,150,0.01\nb,5,6,7,8.5,,,,\n",
        "warm_rig.toml": rig_toml_text(warm).encode(),
        "explained.json": calibration_text(explained).encode(),
        "rig.toml": rig_toml_text(Rig(CollinearTarget(), (1392, 1040), pixel_std=0.1)).encode(),
        "calibration.json": calibration_text(calibration).encode(),
        "deflated.tif": deflated.getvalue(),
    }
    pictures = [name for name in READERS if name not in files]
    return files | {name: cv2.imencode(Path(name).suffix, SMALL)[1].tobytes() for name in pictures}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("damaged")


def read_or_refuse(folder: Path, name: str, content: bytes) -> None:
    """Read the content; an error must be one of ours, in one line, and nothing be written."""
    path = folder / name
    path.write_bytes(content)
    try:
        READERS[name](path)
    except SheetOfLightError as error:
        message = str(error)
        assert name in message
        assert message.isprintable()
        assert " – " in message
    assert path.read_bytes() == content
    path.unlink()
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("name", READERS)
def test_the_good_files_are_good(good: dict[str, bytes], tmp_path: Path, name: str):
    (tmp_path / name).write_bytes(good[name])
    READERS[name](tmp_path / name)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_cut_short(good: dict[str, bytes], folder: Path, name: str, data: st.DataObject):
    whole = good[name]
    read_or_refuse(folder, name, whole[: data.draw(st.integers(0, len(whole)))])


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_bytes_changed(good: dict[str, bytes], folder: Path, name: str, data: st.DataObject):
    content = bytearray(good[name])
    places = st.integers(0, len(content) - 1) | st.integers(0, min(80, len(content) - 1))
    changes = st.lists(st.tuples(places, st.integers(0, 255)), min_size=1, max_size=6)
    for place, byte in data.draw(changes):
        content[place] = byte
    read_or_refuse(folder, name, bytes(content))


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_stretch_taken_out_or_doubled(
    good: dict[str, bytes], folder: Path, name: str, data: st.DataObject
):
    whole = good[name]
    first, last = sorted(data.draw(st.tuples(*[st.integers(0, len(whole))] * 2)))
    times = data.draw(st.sampled_from([0, 2]))
    read_or_refuse(folder, name, whole[:first] + times * whole[first:last] + whole[last:])


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=15)
@given(head=st.integers(0, 12), junk=st.binary(max_size=200))
def test_junk_behind_a_true_beginning(
    good: dict[str, bytes], folder: Path, name: str, head: int, junk: bytes
):
    read_or_refuse(folder, name, good[name][:head] + junk)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)


@pytest.mark.parametrize("name", ["calibration.json", "explained.json"])
@settings(max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_calibration_with_any_value_in_any_place(
    good: dict[str, bytes], folder: Path, name: str, data: st.DataObject
):
    document = json.loads(good[name])
    place: dict[str, object] | list[object] = document
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        inner = place[key]  # pyright: ignore[reportArgumentType, reportCallIssue]
        if not (isinstance(inner, dict | list) and inner and data.draw(st.booleans())):
            break
        place = inner
    place[key] = data.draw(JSON)  # pyright: ignore[reportArgumentType, reportCallIssue]
    read_or_refuse(folder, name, json.dumps(document).encode())
