"""JSON: strict, exact, and the same bytes for the same content."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.documents import json_text, read_json, write_json

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=("Cs",)))
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=20,
)


@settings(max_examples=60)
@given(st.dictionaries(st.text(st.characters(exclude_categories=("Cs",))), VALUES))
def test_every_document_comes_back_exactly(document: dict[str, Any]):
    assert json.loads(json_text(document)) == document
    assert json_text(json.loads(json_text(document))) == json_text(document)


def test_arrays_and_tuples_become_lists():
    document = {"a": np.eye(2), "b": np.int64(3), "c": (np.float64(0.1), True), "d": np.bool_(True)}
    assert json.loads(json_text(document)) == {
        "a": [[1.0, 0.0], [0.0, 1.0]],
        "b": 3,
        "c": [0.1, True],
        "d": True,
    }


def test_a_row_of_numbers_stays_on_one_line():
    row = list(np.linspace(0, 1, 50))
    assert json.dumps(row) in json_text({"matrix": [row, row]}).splitlines()[2]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (math.nan, r"deep.list\[1\] is nan, which JSON cannot say"),
        (np.array([math.inf]), r"deep.list\[1\]\[0\] is inf, which JSON cannot say"),
        ({1: 2}, r"deep.list\[1\] has the key 1 – use text"),
        ({1, 2}, r"deep.list\[1\] is of type set"),
        (b"ab", r"deep.list\[1\] is of type bytes"),
    ],
    ids=["nan", "inf", "key", "set", "bytes"],
)
def test_what_json_cannot_say_is_refused_and_not_written(tmp_path: Path, value: Any, message: str):
    with pytest.raises(InputError, match=f"truth.json: {message}"):
        write_json(tmp_path / "truth.json", {"deep": {"list": [1, value]}})
    assert list(tmp_path.iterdir()) == []


def test_a_document_that_holds_itself_is_refused():
    document: dict[str, Any] = {}
    document["self"] = document
    with pytest.raises(InputError, match="nested too deeply, or holds itself"):
        json_text(document)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": 1,\n "b": [1, 2', "line 2 column 12 is not JSON"),
        ('{"a": 1} {', "line 1 column 10 is not JSON"),
        ('{"a": NaN}', "the value NaN is no JSON number"),
        ('{"a": -Infinity}', "the value -Infinity is no JSON number"),
        ('{"a": 1, "a": 2}', "key 'a' is given twice"),
        ("[" * 100_000, "is nested too deeply"),
        ('{"a": 1' + "0" * 5000 + "}", "holds a number of too many digits"),
        ("[1, 2]", "holds a list of 2, expected an object"),
        ("null", "holds None, expected an object"),
    ],
    ids=["cut", "more", "NaN", "inf", "twice", "nested", "digits", "list", "null"],
)
def test_what_is_no_document(tmp_path: Path, text: str, message: str):
    (tmp_path / "file.json").write_text(text)
    with pytest.raises(InputError, match=rf"file.json:? {message}"):
        read_json(tmp_path / "file.json")


def test_what_is_written_is_read(tmp_path: Path):
    write_json(tmp_path / "truth.json", {"α": 0.1})
    assert read_json(tmp_path / "truth.json") == {"α": 0.1}
    with pytest.raises(FileError):
        write_json(tmp_path / "nowhere" / "truth.json", {})
