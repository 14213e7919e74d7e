"""The page of a verification: self-contained, complete, safe, the same every time."""

from __future__ import annotations

import json
from html.parser import HTMLParser

import numpy as np
import pytest

from sheetoflight.measurement.comparison import KnownLength, MeasuredSegment, PermissibleError
from sheetoflight.measurement.length import Length
from sheetoflight.measurement.verification import Verification, verify_lengths
from sheetoflight.report.verification_page import build_verification_page
from tests.known_lengths import calibrated, true_ends

HOSTILE = "<script>alert('x')</script>\"&amp;"
LENGTHS_MM = [150.0, 300.0, 450.0]


class Page(HTMLParser):
    """Attributes, texts, cells, and the data of the figures."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.attributes: list[tuple[str, str, str]] = []
        self.figures: dict[str, dict] = {}
        self.text = ""
        self.scripts = 0
        self._open: dict[str, str | None] | None = None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self._open = dict(attrs) if tag in ("script", "style") else None
        self.scripts += tag == "script"

    def handle_data(self, data):
        if self._open is None:
            self.text += data
        elif "data-for" in self._open:
            figure = json.loads(data, parse_constant=pytest.fail)
            self.figures[str(self._open["data-for"])] = figure

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self._open = None


def verification(limit: PermissibleError | None = None, name: str = "bar") -> Verification:
    """Errors 0.05, −0.1 and 0.3 mm, each length known to 0.1 mm, and one that is not judged."""
    ends = true_ends([*LENGTHS_MM, 200.0])
    measured = [150.05, 299.9, 450.3, 200.0]
    segments = [
        MeasuredSegment(f"{name}{number}", ends[number], Length(value, 0.1))
        for number, value in enumerate(measured)
    ]
    known = {f"{name}{i}": KnownLength(length, 0.01) for i, length in enumerate(LENGTHS_MM)}
    return verify_lengths(calibrated(), segments, known, limit)


@pytest.mark.parametrize("limit", [None, PermissibleError(0.2)], ids=["none", "limit"])
def test_the_page_says_what_was_found(limit: PermissibleError | None) -> None:
    page = Page(build_verification_page(verification(limit)))
    words = " ".join(page.text.split())
    assert "Verification: failed" in words
    assert "2 of 3" in words
    assert "The worst is bar2 with +0.3 mm" in words
    assert "no statement of conformity" in words
    assert ("nonconformity proven" in words) == (limit is not None)
    assert "bar3" in words
    assert len(page.figures) == 3
    assert all(figure["data"] for figure in page.figures.values())


def test_errors_and_bars_are_drawn_where_they_are() -> None:
    page = Page(build_verification_page(verification(PermissibleError(0.2, per_m=0.1))))
    drawn = {trace["name"]: trace for trace in page.figures["figure-errors"]["data"]}
    assert drawn["failed"]["x"] == [450.0]
    assert drawn["failed"]["y"] == pytest.approx([0.3])
    assert drawn["failed"]["error_y"]["array"] == pytest.approx([1.96 * np.hypot(0.1, 0.01)], 1e-4)
    assert drawn["passed"]["y"] == pytest.approx([0.05, -0.1])


def test_nothing_is_loaded_from_elsewhere() -> None:
    page = Page(build_verification_page(verification()))
    for tag, name, value in page.attributes:
        if name in ("src", "href", "action", "srcset", "poster"):
            assert value.startswith("#"), (tag, name, value[:80])
    ids = {value for _, name, value in page.attributes if name == "id"}
    assert {v[1:] for _, n, v in page.attributes if n == "href"} <= ids
    assert any("default-src 'none'" in value for _, _, value in page.attributes)


def test_the_same_input_gives_the_same_text() -> None:
    assert build_verification_page(verification()) == build_verification_page(verification())


def test_hostile_names_stay_text() -> None:
    hostile = Page(build_verification_page(verification(name=HOSTILE)))
    assert hostile.scripts == Page(build_verification_page(verification())).scripts
    assert f"{HOSTILE}0" in hostile.text
    assert "<script" not in json.dumps(hostile.figures)
