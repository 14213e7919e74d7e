"""comparison.csv and its document: every method and length, and nothing where there is nothing."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

from sheetoflight.io.comparison_table import (
    COMPARISON_COLUMNS,
    comparison_csv,
    comparison_document,
    write_comparison,
)
from tests.compared_methods import comparison


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_method_and_length_has_a_row():
    table = rows(comparison_csv(comparison()))
    assert tuple(table[0]) == COMPARISON_COLUMNS
    assert [(row["method"], float(row["length_mm"])) for row in table] == [
        (name, mm) for name in ("rod-paper", "camera-free", "board-two-step") for mm in (20, 450)
    ]
    first, free, refused = table[0], table[2], table[4]
    assert (first["pictures"], first["trials"], first["refused"]) == ("40", "10", "1")
    assert (first["normal_deg"], first["plane_mm"]) == ("0.05", "1.5")
    assert (first["rms_mm"], first["predicted_mm"], first["bound_mm"]) == ("2.0", "4.0", "1.0")
    assert (first["bound_share"], first["coverage"]) == ("0.5", "0.9")
    assert (free["normal_deg"], free["plane_mm"], free["rms_mm"]) == ("", "", "2.0")
    assert refused["refused"] == "10"
    assert not any(refused[column] for column in COMPARISON_COLUMNS[5:])


def test_times_are_told_only_where_they_are_asked_for(tmp_path: Path):
    assert "seconds" not in rows(comparison_csv(comparison()))[0]
    write_comparison(tmp_path / "c.csv", comparison(), times=True)
    table = rows((tmp_path / "c.csv").read_text())
    assert [row["seconds"] for row in table] == ["2.25", "2.25", "0.01", "0.01", "", ""]


def test_the_document_is_json_with_null_for_what_there_is_not():
    document = json.loads(json.dumps(comparison_document(comparison()), allow_nan=False))
    rod, free, refused = document["methods"]
    assert document["options"]["trials"] == 10
    assert rod["views"] == {"camera": 30, "plane": 10}
    assert rod["lengths"][1]["length_mm"] == 450
    assert (free["normal_deg"], free["bound_share"]) == (None, 0.99)
    assert (refused["lengths"], refused["first_refusal"]) == ([], "too few views")
    assert "seconds" not in rod
    assert comparison_document(comparison(), times=True)["methods"][0]["seconds"] == 2.25
