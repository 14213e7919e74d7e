"""Segments in, lengths out."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sheetoflight.errors import InputError
from sheetoflight.io.segments_csv import LengthRow, lengths_csv, read_segments, write_lengths

HEADER = "segment,u1,v1,u2,v2\n"
FINITE = st.floats(allow_nan=False, allow_infinity=False)
NAMES = st.text(st.characters(exclude_categories=("Cs",)), min_size=1)


def test_segments_are_read_in_their_order(tmp_path: Path):
    path = tmp_path / "segments.csv"
    path.write_text("segment,u1,v1,u2,v2,std,known_mm\nb,1,2,3,4,0.1,\na,5,6,7,8,,150\n")
    segments = read_segments(path)
    assert len(segments) == 2
    assert segments.names == ("b", "a")
    assert segments.uv.tolist() == [[[1, 2], [3, 4]], [[5, 6], [7, 8]]]
    assert segments.std is not None
    assert segments.known_mm is not None
    np.testing.assert_array_equal(segments.std, [0.1, np.nan])
    np.testing.assert_array_equal(segments.known_mm, [np.nan, 150])


def test_columns_that_are_absent_are_none(tmp_path: Path):
    (tmp_path / "segments.csv").write_text(HEADER + "a,1,2,3,4\n")
    segments = read_segments(tmp_path / "segments.csv")
    assert segments.std is None
    assert segments.known_mm is None
    assert segments.known_std_mm is None
    assert segments.laser is None


def test_the_sheet_and_the_known_lengths_uncertainty_are_read(tmp_path: Path):
    path = tmp_path / "segments.csv"
    path.write_text(
        "segment,u1,v1,u2,v2,laser,known_mm,known_std_mm\n"
        "a,1,2,3,4,left,150,0.002\nb,1,2,3,4,,150,0\nc,1,2,3,4, right ,,\n"
    )
    segments = read_segments(path)
    assert segments.laser == ("left", None, "right")
    assert segments.known_std_mm is not None
    np.testing.assert_array_equal(segments.known_std_mm, [0.002, 0.0, np.nan])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (HEADER + "a,1,2,3,4\na,5,6,7,8\n", "line 3: segment 'a' is given twice"),
        (HEADER + "a,1,2,1,2\n", "line 2: both ends of segment 'a' are the same point"),
        (HEADER + "a,1,2,3,x\n", "line 2: 'v2' is 'x', expected a finite number"),
        (HEADER + ",1,2,3,4\n", "line 2: 'segment' is empty"),
        ("segment,u1,v1,u2\na,1,2,3\n", "line 1: column 'v2' is missing"),
        ("segment,u1,v1,u2,v2,known\n", "line 1: unknown column 'known'"),
        ("segment,u1,v1,u2,v2,known_mm\na,1,2,3,4,-150\n", "line 2: 'known_mm' is -150.0, expect"),
        (
            "segment,u1,v1,u2,v2,known_mm,known_std_mm\na,1,2,3,4,,0.1\n",
            "line 2: known_std_mm of segment 'a' is given without known_mm",
        ),
        (
            "segment,u1,v1,u2,v2,known_mm,known_std_mm\na,1,2,3,4,150,-1\n",
            "line 2: 'known_std_mm' is -1.0, expected a number of 0 or more",
        ),
    ],
    ids=[
        *("twice", "no length", "no number", "no name", "missing", "unknown", "negative"),
        *("std of nothing", "negative std"),
    ],
)
def test_bad_segments_are_named(tmp_path: Path, content: str, message: str):
    (tmp_path / "segments.csv").write_text(content)
    with pytest.raises(InputError, match=f"segments.csv {message}"):
        read_segments(tmp_path / "segments.csv")


@settings(max_examples=50)
@given(st.lists(st.tuples(NAMES, FINITE, FINITE, st.tuples(FINITE, FINITE)), max_size=4))
def test_lengths_come_back_exactly(rows: list[LengthRow]):
    header, *lines = csv.reader(io.StringIO(lengths_csv(rows), newline=""))
    assert header == ["segment", "length_mm", "std_mm", "low_mm", "high_mm"]
    assert [(name, *map(float, numbers)) for name, *numbers in lines] == [
        (name, mm, std, *bounds) for name, mm, std, bounds in rows
    ]


def test_numpy_numbers_are_written_as_numbers(tmp_path: Path):
    row = ("a", np.float64(150.03), np.float64(0.05), (np.float64(149.93), np.float64(150.13)))
    write_lengths(tmp_path / "lengths.csv", [row])
    assert (tmp_path / "lengths.csv").read_text() == (
        "segment,length_mm,std_mm,low_mm,high_mm\na,150.03,0.05,149.93,150.13\n"
    )


def test_a_length_that_is_no_number_is_not_written(tmp_path: Path):
    with pytest.raises(InputError, match="segment 'b' has no finite length"):
        write_lengths(
            tmp_path / "lengths.csv", [("a", 1, 1, (0, 2)), ("b", np.nan, np.nan, (0, 1))]
        )
    assert list(tmp_path.iterdir()) == []
