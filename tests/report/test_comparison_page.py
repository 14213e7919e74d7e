"""The page of a comparison: self-contained, complete, safe, the same every time."""

from __future__ import annotations

import json
import re
from html import unescape

import pytest

from sheetoflight.measurement.comparison_options import ComparisonOptions
from sheetoflight.report.comparison_page import build_comparison_page
from tests.compared_methods import comparison

HOSTILE = "<script>alert('x')</script>\"&amp;"


def figure(page: str) -> dict:
    found = re.search(r'data-for="figure-errors">(.*?)</script>', page, flags=re.DOTALL)
    assert found
    return json.loads(found[1], parse_constant=pytest.fail)


def words(page: str) -> str:
    body = page[page.index("<main>") : page.index("</main>")]
    plain = re.sub(r"<script.*?</script>", "", body, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", plain)).split())


def test_all_methods_and_their_numbers_are_shown():
    text = words(build_comparison_page(comparison()))
    assert "3 methods of calibration on one simulated rig, 40 pictures each" in text
    assert "rod-paper 30 camera + 10 plane 0.0500 1.500 50 ± 3 % 91.0 95.0 1" in text
    assert "camera-free 40 plane – – 99 ± 10 % 95.0 96.0 0" in text
    assert "board-two-step 40 board – – – – – 10" in text
    assert "board-two-step refused 10 of 10 trials, the first: too few views" in text
    assert "rod-paper 2.0 50 ± 4 % 45 50 ± 4 %" in text


def test_the_figure_has_every_method_with_a_result_and_its_bound():
    data = figure(build_comparison_page(comparison()))["data"]
    curves = {one["name"]: one for one in data if one.get("mode") == "lines+markers"}
    assert set(curves) == {"rod-paper", "camera-free"}
    assert curves["rod-paper"]["y"] == [2.0, 45.0]
    bounds = [one["y"] for one in data if one.get("showlegend") is False]
    assert bounds == [[1.0, 22.5], [1.0, 22.5]]


def test_the_papers_case_shows_what_is_printed():
    options = ComparisonOptions(
        case="paper", methods=("rod-paper", "camera-free", "board-two-step"), trials=10
    )
    text = words(build_comparison_page(comparison(options=options)))
    assert "the paper’s Tables 3 and 4" in text
    assert "0.25 printed 0.007 0.25 printed 0.065 0.25 printed 0.030" in text
    assert "printed" not in words(build_comparison_page(comparison()))


def test_times_are_shown_only_where_they_are_asked_for():
    assert "Time, s" not in words(build_comparison_page(comparison()))
    assert "2.25" in words(build_comparison_page(comparison(), times=True))


def test_foreign_text_stays_text_and_nothing_is_loaded():
    page = build_comparison_page(comparison(HOSTILE))
    assert HOSTILE not in page
    assert HOSTILE in unescape(page)
    body = page[: page.index("</main>")]
    assert re.findall(r'(?:src|href)="(.*?)"', body) == ["#methods", "#errors", "#provenance"]
    assert "default-src 'none'" in body
    assert build_comparison_page(comparison(HOSTILE)) == page
