"""Known lengths against measured ones, from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sheetoflight.errors import FileError, InputError, UntrustworthyError
from sheetoflight.measurement.comparison import KnownLength, PermissibleError
from sheetoflight.model.covariance import Covariance
from sheetoflight.workflow.simulated import SimulationOptions, simulate
from sheetoflight.workflow.verified import verify
from tests.known_lengths import calibrated, true_ends, write_segments

BARS_MM = [150.0, 300.0, 450.0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration without error and exact segments; not to be changed."""
    folder = tmp_path_factory.mktemp("known")
    calibrated().save(folder / "calibration.json")
    write_segments(folder / "segments.csv", true_ends(BARS_MM), {})
    return folder


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two bars, rendered."""
    folder = tmp_path_factory.mktemp("bars") / "rig"
    few = SimulationOptions(camera_views=1, plane_views=0, bars_mm=(300.0, 150.0), clutter=0)
    simulate(folder, few)
    return folder / "measure"


def verified(folder: Path, table: str, **options):
    (path := folder / "known.csv").write_text(table)
    return verify(folder / "calibration.json", [folder / "segments.csv"], path, **options)


def test_a_table_names_the_known_lengths(folder: Path) -> None:
    found = verified(folder, "segment,known_mm,known_std_mm\ns2,450,0.02\ns0,150,\n")
    assert [one.segment.name for one in found.comparisons] == ["s0", "s2"]
    assert [one.known for one in found.comparisons] == [
        KnownLength(150.0),
        KnownLength(450.0, 0.02),
    ]
    assert [one.error for one in found.comparisons] == pytest.approx([0, 0], abs=1e-6)
    assert [segment.name for segment in found.not_judged] == ["s1"]
    assert found.passed


@pytest.mark.parametrize("known", [300, 300.0, "300", "3e2"], ids=repr)
def test_one_number_is_the_length_of_all(folder: Path, known: str | float) -> None:
    found = verify(folder / "calibration.json", [folder / "segments.csv"], known, known_std=0.01)
    assert {one.known for one in found.comparisons} == {KnownLength(300.0, 0.01)}
    assert [one.error for one in found.comparisons] == pytest.approx([-150, 0, 150], abs=1e-6)


def test_the_known_lengths_may_stand_with_the_segments(folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "segments.csv"
    columns: dict[str, list[object]] = {
        "known_mm": [150.0, "", 450.2],
        "known_std_mm": [0.05, "", ""],
    }
    write_segments(table, true_ends(BARS_MM), columns)
    found = verify(folder / "calibration.json", [table], limit=PermissibleError(0.1))
    assert [one.known.std for one in found.comparisons] == [0.05, 0.0]
    assert [one.segment.name for one in found.failed] == ["s2"]
    (tmp_path / "more.csv").write_text("segment,known_mm\ns1,300\n")
    more = verify(folder / "calibration.json", [table], tmp_path / "more.csv")
    assert len(more.comparisons) == 3
    with pytest.raises(InputError, match=r"'s0' has a known length in segments\.csv and in"):
        verify(folder / "calibration.json", [table], 300)


def test_pictures_are_verified_by_their_names(folder: Path, pictures: Path) -> None:
    (folder / "bars.csv").write_text("segment,known_mm\nbar00,300\nbar01,150\n")
    found = verify(folder / "calibration.json", [pictures], folder / "bars.csv")
    assert [one.segment.name for one in found.comparisons] == ["bar00", "bar01"]
    assert found.passed
    assert found.statistics.largest < 0.5
    off = pictures / "bar00_off.png"
    found = verify(folder / "calibration.json", [off, pictures / "bar01_on.png"], "150")
    assert found.warnings == ("bar00: nothing measured",)
    with pytest.raises(UntrustworthyError, match="no piece of the laser line"):
        verify(folder / "calibration.json", [off], "150")


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("segment,known_mm\ns0,150\nss2,450\n", "'ss2' was not measured – perhaps 's2'"),
        ("segment,known_mm\nrail,150\n", "'rail' was not measured – correct it"),
        ("segment,known_mm\ns0,150\ns0,450\n", "line 3: segment 's0' is given twice"),
        ("segment,known_mm\ns0,-150\n", "line 2: the known length is -150"),
        ("segment,known_mm\ns0,\n", "line 2: 'known_mm' is empty"),
        ("segment,known_mm,known_std_mm\ns0,150,-1\n", "line 2: .* uncertainty is -1"),
        ("segment,length\ns0,150\n", "line 1: unknown column 'length'"),
    ],
    ids=["near", "stranger", "twice", "negative", "empty", "negative std", "column"],
)
def test_bad_tables_are_named(folder: Path, table: str, said: str) -> None:
    with pytest.raises(InputError, match=f"known.csv.*{said}"):
        verified(folder, table)


def test_what_cannot_be_used_is_named(folder: Path) -> None:
    calibration, segments = folder / "calibration.json", folder / "segments.csv"
    with pytest.raises(InputError, match="none of the 3 segments has a known length"):
        verify(calibration, [segments])
    with pytest.raises(InputError, match="'300mm' are neither a number of mm nor a file"):
        verify(calibration, [segments], "300mm")
    with pytest.raises(InputError, match="known_std_mm in the table"):
        verify(calibration, [segments], folder / "known.csv", known_std=0.1)
    with pytest.raises(InputError, match="not both"):
        verify(calibration, [segments, folder], 300)
    with pytest.raises(FileError, match=r"none\.json does not exist"):
        verify(folder / "none.json", [segments], 300)


def test_a_bare_calibration_is_warned_of(folder: Path) -> None:
    calibrated(covariance=Covariance((), np.zeros((0, 0)))).save(folder / "bare.json")
    found = verify(folder / "bare.json", [folder / "segments.csv"], 300)
    assert "no covariance" in found.warnings[0]
