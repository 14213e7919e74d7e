"""The page of a plan: self-contained, complete, the same every time."""

from __future__ import annotations

import json
import re

import pytest

from sheetoflight.calibration.plan import ViewCounts
from sheetoflight.measurement.length_plan import LengthPlan, PlanOptions
from sheetoflight.report.plan_page import build_plan_page
from sheetoflight.workflow.planned import plan
from tests.planned_rigs import RIG_TOML, write_rig

LASERS = '\n[[laser]]\nname = "<b>left"\nsheet_roll_deg = 180\n[[laser]]\nname = "right"\n'


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> LengthPlan:
    path = write_rig(tmp_path_factory.mktemp("planned"), RIG_TOML + LASERS)
    return plan(path, PlanOptions(ViewCounts(12, 6, 2), wanted_mm=0.2, best=True))


def test_every_figure_has_data_and_nothing_is_loaded(found: LengthPlan) -> None:
    page = build_plan_page(found)
    figures = dict(re.findall(r'data-for="([\w-]+)">(.*?)</script>', page))
    maps = [f"figure-map-{laser}-{axis}" for laser in (0, 1) for axis in (0, 1)]
    assert set(figures) == {"figure-positions", "figure-views", *maps}
    assert all(json.loads(text, parse_constant=pytest.fail)["data"] for text in figures.values())
    assert "default-src 'none'" in page
    body = page.partition("<body>")[2].partition("<noscript>")[0]
    assert not re.search(r'(src|href)="(?!#)', body)


def test_the_numbers_are_those_of_the_plan(found: LengthPlan) -> None:
    page = build_plan_page(found)
    assert f"<strong>{found.headline_mm:.3g}" in page
    assert "Nothing had to be assumed" not in page
    assert all(
        position.view.in_words.partition("<")[0] in page for position in found.next_positions
    )


def test_names_stay_text_and_the_page_is_the_same_again(found: LengthPlan) -> None:
    page = build_plan_page(found)
    assert "<b>left" not in page
    assert "&lt;b&gt;left" in page
    assert page == build_plan_page(found)
