"""Stage match of ``points.csv``: it comes back exactly, and damage is named with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sheetoflight.errors import InputError, SheetOfLightError
from sheetoflight.io import match_points
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.io.rig_toml import read_rig_toml, rig_toml_text
from sheetoflight.model.matches import PointMatches
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.workflow.rig_folder import load_rig

HEADER = "view,stage,marker,u,v,std\n"
CAMERA_TOML = "[camera]\nimage_size = [1400, 1000]\n"
GOOD = HEADER + "".join(
    f"shot {view},match,{point},{90 * point + 7 * view},{100 + 50 * point},0.2\n"
    for view in range(3)
    for point in (4, 0, 9)
)


@st.composite
def matched(draw: st.DrawFn) -> PointMatches:
    """Matches of which every view and every point is seen somewhere."""
    views, points = draw(st.integers(1, 3)), draw(st.integers(1, 4))
    finite = st.floats(allow_nan=False, allow_infinity=False)
    uv = draw(hnp.arrays(float, (views, points, 2), elements=finite))
    hidden = draw(hnp.arrays(bool, (views, points)))
    hidden[:, 0] = False
    hidden[0] = False
    uv[hidden] = np.nan
    positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False) | st.just(np.nan)
    std = draw(hnp.arrays(float, (views, points), elements=positive))
    numbers = draw(st.lists(st.integers(0, 999_999_999), min_size=points, max_size=points,
                            unique=True))  # fmt: skip
    names = tuple(f"view, {number}" for number in range(views))
    return PointMatches(names, uv, std, np.array(sorted(numbers)))


@settings(max_examples=60)
@given(matched())
def test_matches_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, matches: PointMatches
) -> None:
    path = tmp_path_factory.getbasetemp() / "matches.csv"
    write_points(path, Observations(matches=matches))
    back = read_points(path, None).matches
    assert back.names == matches.names
    np.testing.assert_array_equal(back.labels, matches.labels)
    np.testing.assert_array_equal(back.uv, matches.uv)
    np.testing.assert_array_equal(back.stds, np.where(matches.seen, matches.stds, np.nan))


def test_matches_and_a_target_share_a_table(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    rng = np.random.default_rng(1)
    camera = TargetViews(("a",), rng.uniform(0, 900, (1, 3, 2)))
    matches = PointMatches(("a", "b"), rng.uniform(0, 900, (2, 5, 2)))
    write_points(path, Observations(camera=camera, matches=matches))
    back = read_points(path, CollinearTarget())
    assert back.counts() == {"camera": 1, "match": 2}
    np.testing.assert_array_equal(back.camera.uv, camera.uv)
    np.testing.assert_array_equal(back.matches.uv, matches.uv)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a,match,laser,1,2,", "line 11: marker is 'laser', expected a whole number from 0"),
        ("a,match,-1,1,2,", "line 11: marker is '-1'"),
        ("a,match,1.5,1,2,", "line 11: marker is '1.5'"),
        ("shot 1,match,9,1,2,", "line 11: point 9 of view 'shot 1' in stage match is given twice"),
        ("a,match,1,1,,", "line 11: 'v' is empty"),
        ("a,match,1,1,nan,", "line 11: 'v' is 'nan', expected a finite number"),
        ("a,match,1,1,2,0", "line 11: 'std' is 0.0, expected a number above zero"),
        (",match,1,1,2,", "line 11: 'view' is empty"),
        ("a,matches,1,1,2,", "line 11: unknown stage 'matches'"),
        ("a,match,1,1,2", "line 11 has 5 cells"),
        ("a,camera,1,1,2,", "line 11: a point of stage camera, but rig.toml has no \\[target\\]"),
        ("a,board,1,1,2,", "line 11: a point of stage board, but rig.toml has no \\[board\\]"),
    ],
)
def test_a_damaged_row_is_named(tmp_path: Path, row: str, said: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(GOOD + row + "\n")
    with pytest.raises(SheetOfLightError, match=said):
        read_points(path, None)


def test_more_views_and_points_than_can_be_matches_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(match_points, "_LARGEST", 8)
    path = tmp_path / "points.csv"
    path.write_text(GOOD)
    with pytest.raises(InputError, match="stage match has 3 points in 3 views"):
        read_points(path, None)


def test_a_rig_of_matches_needs_neither_target_nor_board(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(CAMERA_TOML)
    (tmp_path / "points.csv").write_text(GOOD)
    rig = load_rig(tmp_path)
    assert rig.observations.counts() == {"match": 3}
    assert rig.observations.matches.labels.tolist() == [0, 4, 9]
    assert rig.board is None
    text = rig_toml_text(rig)
    assert "[target]" not in text
    (tmp_path / "rig.toml").write_text(text)
    assert read_rig_toml(tmp_path / "rig.toml").target is None


def test_a_rig_of_pictures_needs_one_of_them(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(CAMERA_TOML)
    with pytest.raises(InputError, match=r"rig\.toml: neither \[target\] nor \[board\] is there"):
        load_rig(tmp_path)


def test_matches_outside_the_picture_and_copied_views_are_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(CAMERA_TOML)
    points = tmp_path / "points.csv"
    points.write_text(GOOD + "shot 0,match,7,1400,20,\n")
    with pytest.raises(InputError, match=r"stage match, view shot 0: point 7 at \(1400, 20\)"):
        load_rig(tmp_path)
    points.write_text(GOOD + GOOD.removeprefix(HEADER).replace("shot 0", "copy").split("shot 1")[0])
    with pytest.raises(InputError, match="view copy repeats view shot 0"):
        load_rig(tmp_path)


def test_a_view_without_a_name_is_not_written(tmp_path: Path) -> None:
    matches = PointMatches(("",), np.ones((1, 2, 2)))
    with pytest.raises(InputError, match="stage match is called ''"):
        write_points(tmp_path / "points.csv", Observations(matches=matches))
    assert not (tmp_path / "points.csv").exists()


def test_a_written_target_rig_keeps_its_target() -> None:
    assert "[target]" in rig_toml_text(Rig(CollinearTarget(), (1400, 1000)))
