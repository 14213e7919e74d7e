"""``points.csv`` comes back exactly; what is wrong with it is named with its line."""

from __future__ import annotations

import csv
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
TARGET = CollinearTarget()

NAMES = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1)


@st.composite
def target_views(draw: st.DrawFn) -> TargetViews:
    """Views with any name, unseen markers, and known or unknown uncertainties."""
    names = draw(st.lists(NAMES, unique=True, max_size=3))
    finite = st.floats(allow_nan=False, allow_infinity=False)
    uv = draw(hnp.arrays(float, (len(names), 3, 2), elements=finite))
    uv[draw(hnp.arrays(bool, (len(names), 3)))] = np.nan
    uv[:, 0] = draw(hnp.arrays(float, (len(names), 2), elements=finite))
    positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False) | st.just(np.nan)
    std = draw(st.none() | hnp.arrays(float, (len(names), 3), elements=positive))
    return TargetViews(tuple(names), uv, std)


def known_std(views: TargetViews) -> np.ndarray:
    """Uncertainties of the markers that were seen, NaN for all others."""
    std = np.full(views.seen.shape, np.nan) if views.std is None else views.std
    return np.where(views.seen, std, np.nan)


@settings(max_examples=80)
@given(camera=target_views(), plane=target_views())
def test_every_observation_comes_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, camera: TargetViews, plane: TargetViews
):
    path = tmp_path_factory.getbasetemp() / "round_trip.csv"
    if len(camera) + len(plane) == 0:
        with pytest.raises(InputError, match="no point to write"):
            write_points(path, Observations(camera, plane))
        return
    write_points(path, Observations(camera, plane))
    back = read_points(path, TARGET)
    for before, after in ((camera, back.camera), (plane, back.plane)):
        assert after.names == before.names
        np.testing.assert_array_equal(after.uv, before.uv)
        np.testing.assert_array_equal(known_std(after), known_std(before))


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
        (HEADER + "a,camera,laser,1,2\n", "line 2: points on the laser line are not adjusted by"),
        (HEADER + "a,crossing,0,1,2\n", "line 2: points of stage crossing are not adjusted by"),
        (HEADER + "a,board,laser,1,2\n", "line 2: points of stage board are not adjusted by this"),
        (HEADER + "a,Camera,0,1,2\n", "line 2: unknown stage 'Camera' – use camera or plane"),
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
