"""``rig.toml``: what the contract's example says, exact round trips, and slips of the pen."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.rig_toml import read_rig_toml, rig_toml_text, write_rig_toml
from sheetoflight.model.camera import DISTORTION_MODELS
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget

EXAMPLE = """
[target]
kind = "collinear"
markers_mm = [0.0, 200.0, 400.0]   # positions from marker 0
tolerance_mm = 0.0                 # 1-sigma of each position, optional
marker = "quadrant"                # quadrant | disc
marker_size_mm = 24.0

[board]                            # only where a board is used
kind = "chessboard"                # chessboard | circles | charuco
columns = 11                       # inner corners, or circle centres
rows = 8
pitch_mm = [12.0, 12.0]

[camera]
image_size = [1392, 1040]          # width, height
distortion = "none"                # none | radial1 | radial2 | brown
skew = false

[noise]
pixel_std = 0.1                    # optional; estimated where absent
"""
POSITIVE = st.floats(1e-300, 1e300)
NAMES = st.text(
    st.characters(categories=("L", "N", "P", "S"), exclude_characters="/."), min_size=1, max_size=60
).filter(lambda name: name.isprintable() and name != "camera")


LASERS = EXAMPLE + '[[laser]]\nname = "left"\n[[laser]]\nname = "right"\n'
STEEL = "tolerance_mm = 0.0\nexpansion_per_K = 11.5e-6\nwarmer_by_K = -4\nwarmer_by_std_K = 0.5\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


@st.composite
def rigs(draw: st.DrawFn) -> Rig:
    further = draw(st.lists(POSITIVE, min_size=2, max_size=6, unique=True))
    target = CollinearTarget(
        (0.0, *sorted(further)),
        draw(st.just(0.0) | POSITIVE),
        draw(st.sampled_from(["quadrant", "disc"])),
        draw(POSITIVE),
        draw(st.just(0.0) | st.floats(1e-9, 1e-4)),
        draw(st.just(0.0) | st.floats(-100, 100)),
        draw(st.just(0.0) | POSITIVE),
        draw(st.just(0.0) | POSITIVE),
    )
    return Rig(
        target,
        (draw(st.integers(1, 100_000)), draw(st.integers(1, 100_000))),
        draw(st.sampled_from(list(DISTORTION_MODELS))),
        draw(st.booleans()),
        draw(st.none() | POSITIVE),
        draw(st.none() | st.just(0.0) | POSITIVE),
        tuple(draw(st.just(["laser"]) | st.lists(NAMES, unique=True, min_size=1, max_size=3))),
    )


def test_the_example_is_read(tmp_path: Path):
    path = written(tmp_path, EXAMPLE)
    rig = read_rig_toml(path).rig()
    assert rig.target == CollinearTarget((0.0, 200.0, 400.0), 0.0, "quadrant", 24.0)
    assert (rig.image_size, rig.distortion, rig.skew, rig.pixel_std) == (
        (1392, 1040),
        "none",
        False,
        0.1,
    )
    assert rig.source == str(path)


def test_only_the_markers_must_be_told(tmp_path: Path):
    file = read_rig_toml(written(tmp_path, "[target]\nmarkers_mm = [0, 100, 250]\n"))
    assert file.target == CollinearTarget((0.0, 100.0, 250.0))
    assert (file.image_size, file.distortion, file.skew, file.pixel_std) == (
        None,
        "none",
        False,
        None,
    )


@settings(max_examples=60)
@given(rigs())
def test_every_rig_comes_back_exactly(tmp_path_factory: pytest.TempPathFactory, rig: Rig):
    path = tmp_path_factory.getbasetemp() / "rig.toml"
    write_rig_toml(path, rig)
    back = read_rig_toml(path).rig(rig.observations)
    for name in (
        *("target", "image_size", "distortion", "skew", "pixel_std", "placement_std", "lasers"),
        "observations",
    ):
        assert getattr(back, name) == getattr(rig, name)


def test_what_is_written_names_its_sections_as_the_example_does():
    text = rig_toml_text(Rig(CollinearTarget(), (1392, 1040), pixel_std=0.1))
    example = tomllib.loads(EXAMPLE)
    del example["board"]
    assert tomllib.loads(text) == example


def test_lasers_temperature_and_placement_are_read(tmp_path: Path):
    text = LASERS.replace("tolerance_mm = 0.0", STEEL, 1).replace(
        "pixel_std = 0.1", "placement_std_mm = 0", 1
    )
    rig = read_rig_toml(written(tmp_path, text)).rig()
    assert rig.lasers == ("left", "right")
    assert (rig.pixel_std, rig.placement_std) == (None, 0.0)
    target = rig.target
    assert (target.expansion_per_K, target.warmer_by_K) == (11.5e-6, -4.0)
    assert (target.warmer_by_std_K, target.expansion_std_per_K) == (0.5, 0.0)


def test_without_lasers_there_is_one_called_laser(tmp_path: Path):
    file = read_rig_toml(written(tmp_path, EXAMPLE))
    assert (file.lasers, file.placement_std) == (("laser",), None)


@pytest.mark.parametrize("name", ["", " left", "a/b", "..", ".hidden", "camera", "a\nb", "x" * 61])
def test_a_laser_whose_name_names_no_folder_is_not_written(tmp_path: Path, name: str):
    rig = Rig(CollinearTarget(), (1392, 1040), lasers=("left", name or "\x7f"))
    with pytest.raises(InputError, match=r"rig.toml: laser\[1\].name is"):
        write_rig_toml(tmp_path / "rig.toml", rig)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"right"', '"left"', "two lasers are called 'left' – give each a name of its own"),
        ('"right"', '""', r"laser\[1\].name is '', expected a word"),
        ('"right"', '"a/b"', r"laser\[1\].name is 'a/b', expected a word"),
        ('"right"', "7", r"laser\[1\].name is 7, expected text in quotes"),
        ('name = "right"', "", r"laser\[1\]: 'name' is missing"),
        ('name = "right"', 'nme = "right"', r"unknown key 'nme' in \[laser\[1\]\] – did you mean"),
        ("[[laser]]", "[[lasers]]", "unknown key 'lasers' – did you mean 'laser'"),
        ("[camera]", "[laser]\n[camera]", "is not TOML"),
        ("warmer_by_std_K = 0.5", "", "target: expansion_per_K is given without warmer_by_std_K"),
        ("expansion_per_K = 11.5e-6", "", "target: warmer_by_K is given without expansion_per_K"),
        ("11.5e-6", "11.5", "the target would be -4600.0% longer than it was measured"),
        ("11.5e-6", "-11.5e-6", "expansion_per_K is -1.15e-05"),
        ("warmer_by_std_K = 0.5", "warmer_by_std_K = -1", "warmer_by_std_K is -1"),
        ("pixel_std = 0.1", "placement_std_mm = -1", "noise.placement_std_mm is -1, expected a nu"),
        ("pixel_std = 0.1", "placement_std = 1", "unknown key 'placement_std' in .noise. – did y"),
    ],
    ids=lambda value: value[:32],
)
def test_slips_of_lasers_and_temperatures(tmp_path: Path, old: str, new: str, message: str):
    text = LASERS.replace("tolerance_mm = 0.0", STEEL, 1)
    assert old in text
    with pytest.raises(InputError, match=rf"rig.toml:? {message}") as caught:
        read_rig_toml(written(tmp_path, text.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_an_empty_list_of_lasers_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="laser is a list of 0, expected 1 entries or more"):
        read_rig_toml(written(tmp_path, "laser = []\n" + EXAMPLE))


def test_the_pictures_tell_their_size(tmp_path: Path):
    file = read_rig_toml(written(tmp_path, "[target]\nmarkers_mm = [0, 1, 2]\n"))
    assert file.rig(Observations(), (640, 480)).image_size == (640, 480)
    with pytest.raises(InputError, match=r"rig.toml: 'image_size' is missing .* – add image_size"):
        file.rig()


def test_a_size_that_the_pictures_do_not_have_is_refused(tmp_path: Path):
    file = read_rig_toml(written(tmp_path, EXAMPLE))
    assert file.rig(picture_size=(1392, 1040)).image_size == (1392, 1040)
    with pytest.raises(
        InputError, match=r"image_size is \[1392, 1040\], but the pictures have 640 × 480 px"
    ):
        file.rig(picture_size=(640, 480))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "markers_mm",
            "marker_mm",
            r"unknown key 'marker_mm' in \[target\] – did you mean 'markers",
        ),
        ("[noise]", "[nose]", "unknown key 'nose' – did you mean 'noise'"),
        ("skew", "zoom", r"unknown key 'zoom' in \[camera\] – known keys are image_size, dist"),
        ("columns", "colums", r"unknown key 'colums' in \[board\] – did you mean 'columns'"),
        ("markers_mm = [0.0, 200.0, 400.0]", "", "target: 'markers_mm' is missing"),
        ("rows = 8", "", "board: 'rows' is missing"),
        ("[0.0, 200.0, 400.0]", '"0 200 400"', "target.markers_mm is '0 200 400', expected a list"),
        ("200.0", '"200"', r"target.markers_mm\[1\] is '200', expected a number"),
        ("200.0", "true", r"target.markers_mm\[1\] is true, expected a number"),
        ("200.0", "nan", r"target.markers_mm\[1\] is nan, expected a finite number"),
        ("200.0", "-inf", r"target.markers_mm\[1\] is -inf, expected a finite number"),
        ("200.0", "2" + "0" * 400, r"target.markers_mm\[1\] is a number of too many digits, expec"),
        ("200.0", "2" + "0" * 5000, "holds a number or date that cannot be"),
        ("[0.0, 200.0", "[1.0, 200.0", r"markers_mm is \[1.0, .*begin with 0 – measure"),
        (
            "[0.0, 200.0",
            "[0.0, 500.0",
            r"markers_mm is \[0.0, 500.0, 400.0\]; the positions must increase",
        ),
        ("[0.0, 200.0, 400.0]", "[0.0, 200.0]", "the target has 2 markers, at least 3"),
        ("tolerance_mm = 0.0", "tolerance_mm = -1", "tolerance_mm is -1"),
        ('"collinear"', '"planar"', "target.kind is 'planar', expected one of 'collinear'"),
        ('"quadrant"', '"ring"', "target.marker is 'ring', expected one of 'quadrant' or 'disc'"),
        ("24.0", "0", "marker_size_mm is 0"),
        ('"chessboard"', '"dots"', "board.kind is 'dots', expected one of 'chessboard', 'circles'"),
        ("columns = 11", "columns = 1", "board.columns is 1, expected a number of 2 or more"),
        ("[12.0, 12.0]", "[12.0]", "board.pitch_mm is a list of 1, expected 2 entries or more"),
        ("[12.0, 12.0]", "[12.0, 0.0]", r"board.pitch_mm\[1\] is 0.0, expected a number above 0"),
        ("[1392, 1040]", "[1392.0, 1040]", r"camera.image_size\[0\] is 1392.0, expected a whole"),
        ("[1392, 1040]", "[1392]", "camera.image_size is a list of 1, expected 2 entries or more"),
        ("[1392, 1040]", "[0, 1040]", r"camera.image_size\[0\] is 0, expected a number of 1 or mo"),
        (
            '"none"',
            '"fisheye"',
            "camera.distortion is 'fisheye', expected one of 'none', 'radial1'",
        ),
        ("false", "0", "camera.skew is 0, expected true or false"),
        ("pixel_std = 0.1", "pixel_std = 0", "noise.pixel_std is 0, expected a number above 0"),
        ("[noise]", "[[noise]]", "noise is a list of 1, expected a table"),
    ],
    ids=lambda value: value[:32],
)
def test_slips_are_named_with_their_key(tmp_path: Path, old: str, new: str, message: str):
    assert old in EXAMPLE
    with pytest.raises(InputError, match=rf"rig.toml:? {message}") as caught:
        read_rig_toml(written(tmp_path, EXAMPLE.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[target]\nmarkers_mm = [0, 1\n", "is not TOML: .*line 3|is not TOML: .*end of document"),
        ("[target]\n\nmarkers_mm 3\n", r"is not TOML: .*at line 3, column 12"),
        ("a = " + "[" * 50_000, "is nested too deeply"),
        ("x" * 2_000_000, "holds more than 1048576 bytes"),
        ("d = 2024-13-45", "is not TOML|cannot be"),
    ],
    ids=["cut", "no equals sign", "nested", "huge", "date"],
)
def test_what_is_no_toml(tmp_path: Path, text: str, message: str):
    with pytest.raises(FileError, match=f"rig.toml ({message})") as caught:
        read_rig_toml(written(tmp_path, text))
    assert "\n" not in str(caught.value)
