"""Point clouds in files: every format gives back what was written, to the precision it states."""

from __future__ import annotations

import csv
import gc
import importlib
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sheetoflight.errors import FileError, InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.clouds import CLOUD_ENDINGS, check_cloud_name, read_cloud, write_cloud
from sheetoflight.model.point_cloud import PointCloud

HEADER = "picture,line,u,v,x,y,z,std_mm,noise_mm,std_x_mm,std_y_mm,std_z_mm,peak"
SINGLE = 2.0**-24  # relative rounding of a 32-bit number
DOUBLE = 2.0**-52
LAS_MM = 0.5e-4 * (1 + 1e-6)  # half a step, and the rounding of the sum that undoes it
ROOT = Path(__file__).parents[2]
PICTURES = ("plain.png", 'a, "b".png', "µ 0.png")


def drawn_cloud(count: int, seed: int = 11) -> PointCloud:
    """A cloud half a metre away, no two columns alike."""
    rng = np.random.default_rng(seed)
    return PointCloud(
        xyz=rng.normal(size=(count, 3)) * [80.0, 50.0, 9.0] + [3.0, -20.0, 562.3],
        std_xyz=rng.uniform(0.001, 0.1, (count, 3)),
        noise_std=rng.uniform(0.001, 0.01, count),
        uv=rng.uniform(0, 1400, (count, 2)),
        peak=rng.uniform(20, 4000, count),
        line=rng.integers(0, 3, count),
        picture=rng.integers(0, len(PICTURES), count),
        pictures=PICTURES,
    )


def expected_columns(cloud: PointCloud) -> dict[str, NDArray[Any]]:
    """What a table says of the points, from the definitions of `PointCloud`."""
    (u, v), (x, y, z), (sx, sy, sz) = cloud.uv.T, cloud.xyz.T, cloud.std_xyz.T
    std = np.sqrt(sx * sx + sy * sy + sz * sz)
    values = [
        cloud.picture,
        cloud.line,
        u,
        v,
        x,
        y,
        z,
        std,
        cloud.noise_std,
        sx,
        sy,
        sz,
        cloud.peak,
    ]
    return dict(zip(HEADER.split(","), values, strict=True))


@pytest.fixture(scope="module")
def cloud() -> PointCloud:
    return drawn_cloud(1000)


@pytest.fixture(params=CLOUD_ENDINGS)
def ending(request: pytest.FixtureRequest) -> str:
    return request.param


# --- Readers that share nothing with the writers ------------------------------------------------


def ply_vertices(path: Path) -> NDArray[Any]:
    """The vertices of a binary PLY file, read as its header says."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    kinds = {"double": "<f8", "float": "<f4", "int32": "<i4"}
    words = [line.split() for line in lines]
    (count,) = (int(word[2]) for word in words if word[:2] == ["element", "vertex"])
    fields = [(word[2], kinds[word[1]]) for word in words if word[0] == "property"]
    vertices = np.frombuffer(body, dtype=fields)
    assert len(vertices) == count
    return vertices


def las_records(path: Path) -> tuple[Array, NDArray[Any]]:
    """Coordinates and whole records of a LAS 1.4 file, by the offsets of its specification."""
    data = path.read_bytes()
    assert data[:4] == b"LASF"
    assert tuple(data[24:26]) == (1, 4)
    start = int(np.frombuffer(data, "<u4", 1, 96)[0])
    kind, length = data[104], int(np.frombuffer(data, "<u2", 1, 105)[0])
    scale, offset = np.frombuffer(data, "<f8", 6, 131).reshape(2, 3)
    count = int(np.frombuffer(data, "<u8", 1, 247)[0])
    floats = HEADER.split(",")[7:]
    extra = [("picture", "<i4"), ("line", "<i4"), ("u", "<f4"), ("v", "<f4")]
    fields = [("steps", "<i4", 3), ("intensity", "<u2"), ("rest", "V16"), *extra]
    records = np.dtype([*fields, *((name, "<f4") for name in floats)])
    assert (kind, length) == (6, records.itemsize)
    assert len(data) == start + count * length
    points = np.frombuffer(data, records, count, start)
    return points["steps"] * scale + offset, points


def e57_scan(path: Path) -> dict[str, NDArray[Any]]:
    """Every field of a scan, the extension's too; cartesian coordinates by pye57's own reader."""
    from pye57 import E57

    libe57 = importlib.import_module("pye57.libe57")
    with E57(str(path)) as file:
        header = file.get_header(0)
        scan = file.read_scan(0, intensity=True, ignore_missing_fields=True)
        further = [name for name in header.point_fields if name.startswith("sol:")]
        buffers = libe57.VectorSourceDestBuffer()
        for name in further:
            scan[name] = np.empty(header.point_count)
            buffers.append(
                libe57.SourceDestBuffer(
                    file.image_file, name, scan[name], header.point_count, True, True
                )
            )
        assert header.points.reader(buffers).read() == header.point_count
    return scan


# --- Every format against its reader -------------------------------------------------------------


def test_csv_brings_every_number_back(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.csv"
    write_cloud(path, cloud)
    assert path.read_text("utf-8").splitlines()[0] == HEADER
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = expected_columns(cloud)
    assert [row["picture"] for row in rows] == [PICTURES[k] for k in expected.pop("picture")]
    assert {row["line"] for row in rows} == {"0", "1", "2"}
    for name, values in expected.items():
        np.testing.assert_allclose([float(row[name]) for row in rows], values, rtol=DOUBLE, atol=0)


def test_xyz_is_a_plain_table(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.xyz"
    write_cloud(path, cloud)
    assert set(path.read_text("ascii")) <= set("0123456789.-e \n")
    table = np.loadtxt(path, comments=None, delimiter=" ")
    np.testing.assert_array_equal(table[:, :3], cloud.xyz)
    np.testing.assert_allclose(table[:, 3], expected_columns(cloud)["std_mm"], rtol=DOUBLE)


def test_npy_has_a_field_for_every_column(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.npy"
    write_cloud(path, cloud)
    points = np.load(path, allow_pickle=False)
    assert ",".join(points.dtype.names) == HEADER
    for name, values in expected_columns(cloud).items():
        np.testing.assert_allclose(points[name], values, rtol=DOUBLE, atol=0)


def test_ply_keeps_coordinates_whole_and_the_rest_to_32_bits(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.ply"
    write_cloud(path, cloud)
    vertices = ply_vertices(path)
    assert list(vertices.dtype.fields or ())[:3] == ["x", "y", "z"]
    np.testing.assert_array_equal(np.stack([vertices[c] for c in "xyz"], axis=1), cloud.xyz)
    for name, values in expected_columns(cloud).items():
        np.testing.assert_allclose(vertices[name], values, rtol=SINGLE, atol=0)
    np.testing.assert_array_equal(read_cloud(path), cloud.xyz)


def test_las_keeps_coordinates_to_half_a_step(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.las"
    write_cloud(path, cloud)
    xyz, records = las_records(path)
    np.testing.assert_allclose(xyz, cloud.xyz, rtol=0, atol=LAS_MM)
    np.testing.assert_allclose(records["intensity"], cloud.peak, rtol=0, atol=0.5)
    for name, values in expected_columns(cloud).items():
        if name not in ("x", "y", "z"):
            np.testing.assert_allclose(records[name], values, rtol=SINGLE, atol=0)


def test_las_names_its_extra_dimensions_and_units(tmp_path: Path, cloud: PointCloud):
    import laspy

    write_cloud(tmp_path / "cloud.las", cloud)
    las = laspy.read(tmp_path / "cloud.las")
    units = {dim.name: dim.description for dim in las.point_format.extra_dimensions}
    assert [*units] == [name for name in HEADER.split(",") if name not in ("x", "y", "z")]
    assert (units["u"], units["std_mm"], units["peak"]) == ("px", "mm", "grey levels")
    assert las.header.creation_date == date(1970, 1, 1)
    assert las.header.global_encoding.wkt
    assert (np.asarray(las.return_number) == 1).all()
    assert (np.asarray(las.number_of_returns) == 1).all()
    np.testing.assert_allclose(las.header.mins, cloud.xyz.min(axis=0), rtol=0, atol=LAS_MM)
    np.testing.assert_allclose(las.header.maxs, cloud.xyz.max(axis=0), rtol=0, atol=LAS_MM)


def test_laz_is_the_same_points_in_less_room(tmp_path: Path, cloud: PointCloud):
    import laspy

    for ending in (".las", ".laz"):
        write_cloud(tmp_path / f"cloud{ending}", cloud)
    las, laz = (laspy.read(tmp_path / f"cloud{ending}") for ending in (".las", ".laz"))
    assert laz.header.are_points_compressed
    assert not las.header.are_points_compressed
    np.testing.assert_array_equal(laz.points.array, las.points.array)
    assert (tmp_path / "cloud.laz").stat().st_size < 0.8 * (tmp_path / "cloud.las").stat().st_size


def test_e57_is_in_metres_its_uncertainties_too(tmp_path: Path, cloud: PointCloud):
    path = tmp_path / "cloud.e57"
    write_cloud(path, cloud)
    scan, expected = e57_scan(path), expected_columns(cloud)
    for name in "XYZ":
        metres = expected.pop(name.lower()) / 1000
        np.testing.assert_allclose(scan.pop(f"cartesian{name}"), metres, rtol=DOUBLE)
    np.testing.assert_allclose(scan.pop("intensity"), expected.pop("peak"), rtol=SINGLE)
    for name, values in expected.items():
        if name.endswith("_mm"):
            # Rounded to 32 bits three times: the value, the factor and the product.
            np.testing.assert_allclose(
                scan.pop(f"sol:{name[:-2]}m"), values / 1000, rtol=3.1 * SINGLE
            )
        else:
            np.testing.assert_allclose(scan.pop(f"sol:{name}"), values, rtol=SINGLE)
    assert not scan


def test_e57_says_its_bounds(tmp_path: Path, cloud: PointCloud):
    from pye57 import E57

    write_cloud(tmp_path / "cloud.e57", cloud)
    with E57(str(tmp_path / "cloud.e57")) as file:
        header = file.get_header(0)
        bounds = [[header.xMinimum, header.yMinimum, header.zMinimum]]
        bounds += [[header.xMaximum, header.yMaximum, header.zMaximum]]
        peaks = [header.intensityMinimum, header.intensityMaximum]
    expected = [cloud.xyz.min(axis=0) / 1000, cloud.xyz.max(axis=0) / 1000]
    np.testing.assert_allclose(bounds, expected, rtol=DOUBLE)
    np.testing.assert_allclose(peaks, [cloud.peak.min(), cloud.peak.max()], rtol=SINGLE)


# --- Sizes at the edge ---------------------------------------------------------------------------


def e57_count(path: Path) -> int:
    from pye57 import E57

    with E57(str(path)) as file:
        return sum(file.get_header(k).point_count for k in range(file.scan_count))


COUNTS: dict[str, Callable[[Path], int]] = {
    ".ply": lambda path: len(ply_vertices(path)),
    ".las": lambda path: len(las_records(path)[0]),
    ".laz": lambda path: len(importlib.import_module("laspy").read(path).points),
    ".e57": e57_count,
    ".csv": lambda path: len(path.read_text("utf-8").splitlines()) - 1,
    ".xyz": lambda path: len(path.read_text("ascii").splitlines()),
    ".npy": lambda path: len(np.load(path)),
}


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_points_and_none(tmp_path: Path, ending: str, count: int):
    path = tmp_path / f"cloud{ending}"
    write_cloud(path, drawn_cloud(count))
    assert COUNTS[ending](path) == count
    assert list(tmp_path.iterdir()) == [path]


def test_no_points_whose_arrays_lost_their_kind(tmp_path: Path, ending: str):
    """A list without elements becomes an array of floats, without pictures too."""
    nothing = np.array([])
    pairs, triples = nothing.reshape(0, 2), nothing.reshape(0, 3)
    kindless: Any = nothing
    empty = PointCloud(triples, triples, nothing, pairs, nothing, kindless, kindless, ())
    write_cloud(tmp_path / f"cloud{ending}", empty)
    assert COUNTS[ending](tmp_path / f"cloud{ending}") == 0


def test_an_empty_ply_is_read_as_no_points(tmp_path: Path):
    write_cloud(tmp_path / "cloud.ply", drawn_cloud(0))
    assert read_cloud(tmp_path / "cloud.ply").shape == (0, 3)


def test_a_large_cloud_takes_seconds(tmp_path: Path, ending: str):
    """A scan of some hundred pictures; the limit allows for a slow and busy machine."""
    large = drawn_cloud(300_000)
    begin = time.process_time()
    write_cloud(tmp_path / f"cloud{ending}", large)
    assert time.process_time() - begin < 30
    assert COUNTS[ending](tmp_path / f"cloud{ending}") == len(large)


# --- LAS has an end ------------------------------------------------------------------------------


def spread_cloud(half_extent_mm: float) -> PointCloud:
    two = drawn_cloud(2)
    return replace(two, xyz=np.array([[-half_extent_mm, 0, 500], [half_extent_mm, 0, 500]]))


@pytest.mark.parametrize("ending", [".las", ".laz"])
def test_points_too_far_apart_for_las_are_refused(tmp_path: Path, ending: str):
    path = tmp_path / f"cloud{ending}"
    with pytest.raises(InputError, match=r"up to 429\.5 m apart; .* – leave out .*\.ply, \.e57"):
        write_cloud(path, spread_cloud(214_748.4))  # 2³¹ steps of 0.0001 mm are 214 748.3648 mm
    assert list(tmp_path.iterdir()) == []


def test_points_nearly_too_far_apart_keep_their_step(tmp_path: Path):
    far = spread_cloud(214_748.3)
    write_cloud(tmp_path / "cloud.las", far)
    xyz, _ = las_records(tmp_path / "cloud.las")
    np.testing.assert_allclose(xyz, far.xyz, rtol=0, atol=LAS_MM)


def test_points_far_from_the_camera_keep_their_step(tmp_path: Path):
    near = drawn_cloud(50)
    far = replace(near, xyz=near.xyz + np.array([0, 0, 5e6]))
    write_cloud(tmp_path / "cloud.las", far)
    xyz, _ = las_records(tmp_path / "cloud.las")
    np.testing.assert_allclose(xyz, far.xyz, rtol=0, atol=LAS_MM)


def test_a_peak_beyond_16_bits_is_the_brightest_intensity(tmp_path: Path):
    bright = replace(drawn_cloud(3), peak=np.array([-1.0, 70_000.0, 65_535.0]))
    write_cloud(tmp_path / "cloud.las", bright)
    _, records = las_records(tmp_path / "cloud.las")
    assert records["intensity"].tolist() == [0, 65_535, 65_535]
    assert records["peak"].tolist() == [-1.0, 70_000.0, 65_535.0]


# --- Same bytes, whole or not at all -------------------------------------------------------------

_WRITE = """
import sys
from tests.io.test_clouds import drawn_cloud
from sheetoflight.io.clouds import write_cloud
for path in sys.argv[1:]:
    write_cloud(path, drawn_cloud(200))
"""


def test_another_process_writes_the_same_bytes_a_moment_later(tmp_path: Path):
    here = [tmp_path / f"here{ending}" for ending in CLOUD_ENDINGS]
    there = [tmp_path / f"there{ending}" for ending in CLOUD_ENDINGS]
    for path in here:
        write_cloud(path, drawn_cloud(200))
    subprocess.run([sys.executable, "-c", _WRITE, *there], check=True, cwd=ROOT)
    for one, other in zip(here, there, strict=True):
        assert one.read_bytes() == other.read_bytes(), one.suffix


def test_another_cloud_has_another_identifier(tmp_path: Path):
    """E57 readers may take two files of one identifier for the same."""
    from pye57 import E57

    guids = set()
    for seed in (1, 2):
        write_cloud(tmp_path / "cloud.e57", drawn_cloud(5, seed))
        with E57(str(tmp_path / "cloud.e57")) as file:
            guids |= {file.root["guid"].value(), file.get_header(0).node["guid"].value()}
    assert len(guids) == 4


@contextmanager
def full_disk(limit: int) -> Iterator[None]:
    """No file may grow beyond so many bytes, whichever library writes it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.999])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, cloud: PointCloud, ending: str, share: float
):
    """Full from the beginning, in the middle, and where only the last bytes find no room."""
    path = tmp_path / f"cloud{ending}"
    write_cloud(path, cloud)
    limit = int(share * path.stat().st_size)
    path.write_text("old")
    with full_disk(limit), pytest.raises(FileError, match="cannot be written"):
        write_cloud(path, cloud)
    gc.collect()  # a library that is left in pieces would crash here, and not in another test
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_named(tmp_path: Path, cloud: PointCloud, ending: str):
    with pytest.raises(FileError, match=r"nowhere/cloud.* cannot be written .* – make the folder"):
        write_cloud(tmp_path / "nowhere" / f"cloud{ending}", cloud)


def test_a_name_of_a_picture_that_is_no_text(tmp_path: Path):
    broken = replace(drawn_cloud(3), pictures=("\udcff.png", "b", "c"), picture=np.zeros(3, int))
    with pytest.raises(InputError, match="characters that are no text"):
        write_cloud(tmp_path / "cloud.csv", broken)
    assert list(tmp_path.iterdir()) == []


# --- Names ---------------------------------------------------------------------------------------


def test_an_ending_in_capitals_is_the_same(tmp_path: Path, cloud: PointCloud, ending: str):
    check_cloud_name(f"CLOUD{ending.upper()}")
    write_cloud(tmp_path / f"one{ending}", cloud)
    write_cloud(tmp_path / f"ONE{ending.upper()}", cloud)
    one, other = sorted(tmp_path.iterdir())
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("name", ["cloud.pcd", "cloud", "ply", ".ply", "cloud.ply.gz", "cl.p\nly"])
def test_another_ending_is_refused_and_the_endings_are_named(tmp_path: Path, name: str):
    with pytest.raises(InputError) as refused:
        write_cloud(tmp_path / name, drawn_cloud(1))
    assert all(ending in refused.value.remedy for ending in CLOUD_ENDINGS)
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"end the name in \.ply, .* or \.npy"):
        check_cloud_name(name)
    assert list(tmp_path.iterdir()) == []


def test_only_ply_is_read(tmp_path: Path):
    with pytest.raises(InputError, match=r"read as '\.csv' – give a \.ply file"):
        read_cloud(tmp_path / "cloud.csv")


def test_an_ascii_ply_of_another_program_is_read(tmp_path: Path):
    path = tmp_path / "cloud.ply"
    path.write_text(
        "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 2\nproperty float x\n"
        "property float y\nproperty float z\nproperty uchar red\nend_header\n"
        "1 2 3 255\n-4 5.5 6e1 0\n"
    )
    np.testing.assert_array_equal(read_cloud(path), [[1, 2, 3], [-4, 5.5, 60]])


@pytest.mark.parametrize("kept", [0, 3, 40, 200, -1, -64, -64_000], ids=str)
def test_a_ply_cut_short_is_named(tmp_path: Path, cloud: PointCloud, kept: int):
    """Also between two of its 1000 vertices, of 64 bytes each, and before the first."""
    path = tmp_path / "cloud.ply"
    write_cloud(path, cloud)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(FileError, match=r"cloud\.ply cannot be read as PLY"):
        read_cloud(path)


def test_a_missing_ply_is_named(tmp_path: Path):
    with pytest.raises(FileError, match="does not exist"):
        read_cloud(tmp_path / "cloud.ply")


def test_the_libraries_are_loaded_when_they_are_needed():
    code = "import sys, sheetoflight.io.clouds; print(sorted(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout
    assert "'sheetoflight.io.clouds.e57'" in loaded
    assert not any(f"'{name}'" in loaded for name in ("laspy", "lazrs", "meshio", "pye57"))
