"""``points.csv`` comes back exactly; what is wrong with it is named with its line."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.points_csv import read_points, write_points
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.target import CollinearTarget

HEADER = "view,stage,marker,u,v\n"
SHEETS = "view,stage,marker,u,v,laser\n"
TARGET = CollinearTarget()
LASERS = ("left", "right")

NAMES = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1)


@st.composite
def target_views(draw: st.DrawFn, spots: int = 0, sheets: int = 1) -> TargetViews:
    """Views with any name, unseen markers, and known or unknown uncertainties."""
    names = draw(st.lists(NAMES, unique=True, max_size=3))
    count, points = len(names), 3 + spots
    finite = st.floats(allow_nan=False, allow_infinity=False)
    uv = draw(hnp.arrays(float, (count, points, 2), elements=finite))
    uv[draw(hnp.arrays(bool, (count, points)))] = np.nan
    always = draw(st.integers(3, points - 1)) if spots else 0
    uv[:, always] = draw(hnp.arrays(float, (count, 2), elements=finite))
    positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False) | st.just(np.nan)
    std = draw(st.none() | hnp.arrays(float, (count, points), elements=positive))
    laser = draw(hnp.arrays(int, count, elements=st.integers(0, sheets - 1)))
    return TargetViews(tuple(names), uv, std, laser)


@st.composite
def observed(draw: st.DrawFn) -> tuple[Observations, tuple[str, ...]]:
    """Views of all stages of a rig with one to three lasers, called anything."""
    lasers = tuple(draw(st.lists(NAMES, unique=True, min_size=1, max_size=3)))
    stages = (target_views(), target_views(sheets=len(lasers)), target_views(spots=len(lasers)))
    camera, plane, crossing = map(draw, stages)
    return Observations(camera, plane, crossing), lasers


def known_std(views: TargetViews) -> np.ndarray:
    """Uncertainties of the markers that were seen, NaN for all others."""
    std = np.full(views.seen.shape, np.nan) if views.std is None else views.std
    return np.where(views.seen, std, np.nan)


@settings(max_examples=80)
@given(observed())
def test_every_observation_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, observed: tuple[Observations, tuple[str, ...]]
):
    path = tmp_path_factory.getbasetemp() / "round_trip.csv"
    observations, lasers = observed
    if not observations.stages():
        with pytest.raises(InputError, match="no point to write"):
            write_points(path, observations, lasers)
        return
    write_points(path, observations, lasers)
    back = read_points(path, TARGET, lasers)
    assert back.stages().keys() == observations.stages().keys()
    for stage, before in observations.stages().items():
        after = back.stages()[stage]
        assert after.names == before.names
        np.testing.assert_array_equal(after.uv, before.uv)
        np.testing.assert_array_equal(known_std(after), known_std(before))
    np.testing.assert_array_equal(back.plane.lasers, observations.plane.lasers)


def test_the_column_laser_is_written_where_there_are_several(
    tmp_path: Path, two_lasers: Observations
):
    write_points(tmp_path / "points.csv", two_lasers, LASERS)
    with (tmp_path / "points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    named = {(row["stage"], row["view"], row["marker"]): row["laser"] for row in rows}
    assert named["camera", "camera00", "0"] == ""
    assert (named["plane", "plane00", "0"], named["plane", "plane01", "2"]) == LASERS
    assert named["crossing", "both", "1"] == ""
    spots = [row for row in rows if row["stage"] == "crossing" and row["marker"] == "laser"]
    assert [(row["view"], row["laser"]) for row in spots] == [
        *(("left only", "left"), ("right only", "right")),
        *((view, laser) for view in ("one", "both") for laser in LASERS),
    ]


def test_spots_stand_behind_the_markers(tmp_path: Path):
    (tmp_path / "points.csv").write_text(
        HEADER + "c,crossing,laser,7,8\nc,crossing,2,5,6\nc,crossing,0,1,2\n"
    )
    views = read_points(tmp_path / "points.csv", TARGET).crossing
    nan = [np.nan, np.nan]
    np.testing.assert_array_equal(views.uv, [[[1, 2], nan, [5, 6], [7, 8]]])


@pytest.mark.parametrize(
    ("content", "lasers"),
    [
        (HEADER + "p,plane,0,1,2\nc,crossing,laser,3,4\n", ("laser",)),
        (SHEETS + "p,plane,0,1,2,\nc,crossing,laser,3,4,\n", ("laser",)),
        (SHEETS + "p,plane,0,1,2,blue\nc,crossing,laser,3,4, blue \n", ("blue",)),
        (SHEETS + "p,plane,0,1,2,left\nc,crossing,laser,3,4,left\n", LASERS),
    ],
    ids=["absent", "empty", "the only one", "one of two"],
)
def test_one_laser_need_not_be_named(tmp_path: Path, content: str, lasers: tuple[str, ...]):
    (tmp_path / "points.csv").write_text(content)
    seen = read_points(tmp_path / "points.csv", TARGET, lasers)
    assert seen.plane.lasers.tolist() == [0]
    assert seen.crossing.uv.shape == (1, 3 + len(lasers), 2)
    assert seen.crossing.uv[0, 3].tolist() == [3.0, 4.0]


def test_every_stage_may_stand_alone(tmp_path: Path, two_lasers: Observations):
    for stage, views in two_lasers.stages().items():
        write_points(tmp_path / "points.csv", replace(Observations(), **{stage: views}), LASERS)
        back = read_points(tmp_path / "points.csv", TARGET, LASERS)
        assert list(back.stages()) == [stage]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("a,plane,0,1,2,\n", "line 2: the rig has 2 lasers, .* – write 'left' or 'right' into co"),
        ("a,plane,0,1,2,left\na,plane,1,3,4,\n", "line 3: the rig has 2 lasers, and the row"),
        ("a,crossing,laser,1,2,\n", "line 2: the rig has 2 lasers, and the row names none"),
        ("a,plane,0,1,2,top\n", "line 2: unknown laser 'top' – use 'left' or 'right', or name"),
        ("a,camera,0,1,2,top\n", "line 2: unknown laser 'top'"),
        (
            "a,plane,0,1,2,left\na,plane,1,3,4,right\n",
            "line 3: view 'a' of stage plane is of laser 'right', and before of laser 'left'",
        ),
        (
            "a,crossing,laser,1,2,left\na,crossing,laser,3,4,left\n",
            "line 3: the spot of laser 'left' of view 'a' in stage crossing is given twice",
        ),
        (
            "a,crossing,laser,1,2,left\nb,crossing,0,1,2,\nb,crossing,1,3,4,\n",
            "line 3: view 'b' of stage crossing has no spot – add a row with marker laser",
        ),
        ("a,plane,laser,1,2,left\n", "line 2: a point of marker laser stands in stage plane"),
        ("a,board,laser,1,2,\n", "line 2: the rig has 2 lasers, and the row names none"),
    ],
    ids=lambda value: value[:30],
)
def test_lasers_that_are_not_clear_are_named_with_their_line(
    tmp_path: Path, rows: str, message: str
):
    (tmp_path / "points.csv").write_text(SHEETS + rows)
    with pytest.raises(InputError, match=f"points.csv {message}") as caught:
        read_points(tmp_path / "points.csv", TARGET, LASERS)
    assert "\n" not in str(caught.value)


def test_what_could_not_be_read_again_is_not_written(tmp_path: Path, two_lasers: Observations):
    path, crossing = tmp_path / "points.csv", two_lasers.crossing
    spots = np.zeros(crossing.seen.shape, bool)
    spots[3, 3:] = True
    with pytest.raises(InputError, match="view 'both' of stage crossing has no spot"):
        write_points(path, Observations(crossing=crossing.without(spots)), LASERS)
    with pytest.raises(InputError, match="sheet 1, counted from 0, and there are 1 lasers"):
        write_points(path, Observations(plane=two_lasers.plane))
    with pytest.raises(InputError, match="views of stage crossing have 5 points"):
        write_points(path, Observations(crossing=crossing), ("a", "b", "c"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a,b", 'say "x"', "two\nlines", "a\rb", " padded ", "'", "laser"])
def test_any_text_is_a_view_name(tmp_path: Path, name: str):
    before = TargetViews((name,), np.arange(6.0).reshape(1, 3, 2))
    write_points(tmp_path / "points.csv", Observations(plane=before))
    assert read_points(tmp_path / "points.csv", TARGET).plane.names == (name,)


def test_a_spreadsheet_reads_what_is_written(tmp_path: Path, observations: Observations):
    write_points(tmp_path / "points.csv", observations)
    with (tmp_path / "points.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["view", "stage", "marker", "u", "v", "std"]
    assert len(rows) == observations.camera.seen.sum() + observations.plane.seen.sum()
    assert [float(row["std"]) for row in rows if row["std"]] == [0.1 + 0.2]


def test_a_view_in_which_nothing_was_seen_has_no_row(tmp_path: Path):
    uv = np.full((2, 3, 2), np.nan)
    uv[1] = 7.0
    write_points(tmp_path / "points.csv", Observations(TargetViews(("dark", "lit"), uv)))
    assert read_points(tmp_path / "points.csv", TARGET).camera.names == ("lit",)


def test_rows_come_in_any_order(tmp_path: Path, observations: Observations):
    path = tmp_path / "points.csv"
    write_points(path, observations)
    header, *rows = path.read_text().splitlines()
    shuffled = np.random.default_rng(3).permutation(rows).tolist()
    path.write_text("\n".join([header, *shuffled]))
    back = read_points(path, TARGET)
    order = [back.plane.names.index(name) for name in observations.plane.names]
    np.testing.assert_array_equal(back.plane.uv[order], observations.plane.uv)


@pytest.mark.parametrize(
    "content",
    [
        "\ufeff" + HEADER + "a,camera,0,1,2\n",
        HEADER.replace("\n", "\r\n") + "a,camera,0,1,2\r\n",
        HEADER + "\n\na,camera,0,1,2",
        ' view, stage ,marker,u,v\n"a",camera, 0 , +1.0 ,2e0\n',
        "v,u,marker,stage,view\n2,1,0,camera,a\n",
        "view,stage,marker,u,v,std,x,y,z\na,camera,0,1,2,,1,-2,.5\n",
    ],
    ids=["BOM", "CRLF", "blank lines", "spaces and quotes", "column order", "board columns"],
)
def test_what_programs_make_of_a_table_is_read(tmp_path: Path, content: str):
    (tmp_path / "points.csv").write_bytes(content.encode())
    views = read_points(tmp_path / "points.csv", TARGET).camera
    assert views.names == ("a",)
    assert views.uv[0, 0].tolist() == [1.0, 2.0]
    assert not views.seen[0, 1:].any()
    assert views.std is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("view;stage;marker;u;v\n", "line 1: the columns are separated by ';', expected ','"),
        ("view\tstage\tmarker\tu\tv\n", "line 1: the columns are separated by a tab"),
        ("view,stage,marker,u\na,camera,0,1\n", "line 1: column 'v' is missing"),
        ("view,stage,marker,u,v,w\n", "line 1: unknown column 'w' – use view,stage,marker,u,v,"),
        ("view,stage,marker,u,u,v\n", "line 1: column 'u' is given twice"),
        (HEADER, "holds a header and no row"),
        (HEADER + "a,camera,0,1\n", "line 2 has 4 cells, expected 5"),
        (HEADER + "a,camera,0,1,5,2,5\n", "line 2 has 7 cells, expected 5 – .* decimals with '.'"),
        (HEADER + "a,camera,0,1,2\na,camera,1,nan,2\n", "line 3: 'u' is 'nan', expected a finite"),
        (HEADER + "a,camera,0,1,-inf\n", "line 2: 'v' is '-inf', expected a finite number"),
        (HEADER + "a,camera,0,1e999,2\n", "line 2: 'u' is '1e999', expected a finite number"),
        (HEADER + "a,camera,0,1_0,2\n", "line 2: 'u' is '1_0', expected a finite number"),
        (HEADER + "a,camera,0,١,2\n", "line 2: 'u' is '١', expected a finite number"),
        (HEADER + "a,camera,0,far,2\n", "line 2: 'u' is 'far', expected a finite number"),
        (HEADER + "a,camera,0,,2\n", "line 2: 'u' is empty, expected a number – .* remove the row"),
        (HEADER + ",camera,0,1,2\n", "line 2: 'view' is empty"),
        (HEADER + "a,camera,3,1,2\n", "line 2: marker is '3', expected a whole number from 0 to 2"),
        (HEADER + "a,camera,-1,1,2\n", "line 2: marker is '-1', expected a whole number"),
        (HEADER + "a,camera,1.0,1,2\n", "line 2: marker is '1.0', expected a whole number"),
        (HEADER + f"a,camera,{'9' * 5000},1,2\n", "line 2: marker is '9{59}"),
        (HEADER + "a,camera,laser,1,2\n", "line 2: a point of marker laser stands in stage camera"),
        (HEADER + "a,crossing,0,1,2\n", "line 2: view 'a' of stage crossing has no spot"),
        (HEADER + "a,board,laser,1,2\n", "line 2: a point of stage board, but rig.toml has no"),
        (HEADER + "a,Camera,0,1,2\n", "line 2: unknown stage 'Camera' – use camera, plane, cros"),
        (
            HEADER + "a,camera,0,1,2\nb,camera,0,1,2\na,camera,0,3,4\n",
            "line 4: marker 0 of view 'a' in stage camera is given twice",
        ),
        (
            "view,stage,marker,u,v,std\na,camera,0,1,2,0\n",
            "line 2: 'std' is 0.0, expected a number",
        ),
        ("view,stage,marker,u,v,x\na,camera,0,1,2,left\n", "line 2: 'x' is 'left', expected a"),
        (HEADER + 'a,camera,0,1,2\n"b,camera,0,1,2\n', "line 3 is no comma-separated text"),
        (HEADER + f"{'a' * 200_000},camera,0,1,2\n", "line 2 is no comma-separated text"),
        (HEADER + 'a,camera,0,1,2\n"two\nlines",camera,0,x,2\n', "line 3: 'u' is 'x'"),
    ],
    ids=lambda value: None if value.startswith(("view", "v,u")) else value.split(" – ")[0][:40],
)
def test_bad_tables_are_named_with_their_line(tmp_path: Path, content: str, message: str):
    (tmp_path / "points.csv").write_text(content)
    with pytest.raises(InputError, match=f"points.csv {message}") as caught:
        read_points(tmp_path / "points.csv", TARGET)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "line 3 holds a NUL byte"),
        (HEADER.encode() + b"caf\xe9,camera,0,1,2\n", "line 2 is not UTF-8 text"),
    ],
    ids=["empty", "binary", "Latin-1"],
)
def test_what_is_no_text_is_said(tmp_path: Path, content: bytes, message: str):
    (tmp_path / "points.csv").write_bytes(content)
    with pytest.raises(FileError, match=f"points.csv {message}"):
        read_points(tmp_path / "points.csv", TARGET)


@pytest.mark.parametrize("name", ["", "a\0b", "\udcff"], ids=["none", "NUL", "no text"])
def test_a_view_without_a_name_that_can_be_read_again_is_not_written(tmp_path: Path, name: str):
    with pytest.raises(InputError):
        write_points(
            tmp_path / "points.csv", Observations(TargetViews((name,), np.zeros((1, 3, 2))))
        )
    assert list(tmp_path.iterdir()) == []
