"""The page as a browser reads it: self-contained, complete, safe, the same every time."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from sheetoflight.model.calibration import ViewResiduals
from sheetoflight.report.contents import Table
from sheetoflight.report.page import build_report
from tests.report.examples import (
    NO_COVARIANCE,
    SHARES,
    calibration_of_two_lasers,
    example_calibration,
    facing_calibration,
)

HOSTILE = "<script>alert('x')</script><img src=x onerror=alert(1)>\"'&amp;</title>"
TABLE = Table(
    "Lengths by method",
    ("method", "150 mm", "n"),
    (("joint", "0.029", 12), ("paper", 0.1987654321, 3)),
    "Mean absolute error.",
    (0,),
)


class Page(HTMLParser):
    """Elements, attributes, the cells of all tables, and the texts of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: Counter[str] = Counter()
        self.attributes: list[tuple[str, str, str]] = []
        self.cells: list[list[str]] = []
        self.raw: list[tuple[dict[str, str | None], str]] = []
        self.text = ""
        self._open: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        self._open.append((tag, dict(attrs)))
        if tag == "tr":
            self.cells.append([])
        if tag in ("td", "th"):
            self.cells[-1].append("")

    def handle_data(self, data):
        tag, attributes = self._open[-1] if self._open else ("", {})
        if tag in ("script", "style"):
            self.raw.append((attributes, data))
            return
        self.text += data
        if any(name in ("td", "th") for name, _ in self._open[-3:]):
            self.cells[-1][-1] += data

    def handle_endtag(self, tag):
        while self._open and self._open.pop()[0] != tag:
            pass

    def figures(self) -> dict[str, dict]:
        return {
            str(attributes["data-for"]): json.loads(text)
            for attributes, text in self.raw
            if attributes.get("type") == "application/json"
        }

    def own_code(self) -> str:
        """Styles and scripts but for the plotting library, which is a single long script."""
        return "".join(text for _, text in self.raw if len(text) < 1_000_000)


@pytest.fixture(scope="module")
def text(calibration, picture) -> str:
    return build_report(calibration, [picture], [TABLE])


@pytest.fixture(scope="module")
def page(text) -> Page:
    return Page(text)


def test_nothing_is_loaded_from_elsewhere(page: Page):
    for tag, name, value in page.attributes:
        if name in ("src", "href", "xlink:href", "action", "srcset", "poster", "data"):
            assert value.startswith(("data:image/png;base64,", "#")), (tag, name, value[:80])
        assert name != "style" or "url(" not in value
    assert not re.search(r"@import|url\(|https?://|//cdn", page.own_code())
    assert page.tags["link"] == page.tags["iframe"] == page.tags["base"] == 0


def test_the_browser_is_told_to_load_nothing(page: Page):
    (policy,) = [v for tag, n, v in page.attributes if tag == "meta" and "default-src" in v]
    rules = dict(part.split(maxsplit=1) for part in policy.split("; "))
    assert rules["default-src"] == "'none'"
    assert "http" not in policy
    assert "*" not in policy


def test_no_button_offers_to_send_the_data_away(page: Page):
    assert "showSendToCloud: false" in page.own_code()
    assert 'plotlyServerURL: ""' in page.own_code()


def test_the_plotting_library_is_there_once(page: Page):
    assert [len(text) > 1_000_000 for _, text in page.raw].count(True) == 1


def test_the_page_stays_below_eight_megabytes(text: str):
    assert len(text.encode()) < 8e6


def test_the_same_input_gives_the_same_text(text, calibration, picture):
    assert build_report(example_calibration(), [picture], [TABLE]) == text


@pytest.mark.parametrize(
    "row",
    [
        ["focal length along u", "α", "2298.7", "4.2", "px"],
        ["focal length along v", "β", "2288.8", "4.1", "px"],
        ["skew of the image axes", "γ", "0", "fixed", "px"],
        ["principal point", "u0", "689.3", "3.3", "px"],
        ["radial distortion", "k1", "-0.1000", "0.0021", ""],
        ["radial distortion", "k3", "0", "fixed", ""],
        ["distance from the camera", "d", "562.33", "0.43", "mm"],
        ["joint", "0.029", "12"],
        ["paper", "0.198765", "3"],
    ],
    ids=lambda row: " ".join(row[:2]),
)
def test_every_number_stands_in_its_row(page: Page, row: list[str]):
    assert row in page.cells


def test_the_headline_says_what_a_reader_asks_first(page: Page):
    words = " ".join(page.text.split())
    for part in (
        "calibrated by the joint method from 12 camera views and 10 plane views",
        "A length of 100 mm in the sheet is known with a standard uncertainty of",
        "0.10 px",
        "1.013",
        "The residuals agree with this noise.",
        "Warning. Few views reach into the corners.",
        "−1.6179 X − 0.1551 Y − 0.7216 Z + 1000 = 0",
        "options.distortion",
        "1 piece of the line leaves the picture, fades out or bends, and has neither length nor",
        "Mean absolute error.",
    ):
        assert part in words, part


def test_every_figure_has_its_place_and_its_data(page: Page):
    places = [value for tag, name, value in page.attributes if (tag, name) == ("div", "id")]
    assert len(places) == len(set(places)) == 7
    figures = page.figures()
    assert set(figures) == set(places)
    assert all(figure["data"] for figure in figures.values())


def test_links_of_the_page_lead_somewhere(page: Page):
    ids = {value for _, name, value in page.attributes if name == "id"}
    links = {v.removeprefix("#") for _, n, v in page.attributes if n == "href" and v[0] == "#"}
    assert links
    assert links <= ids


def test_hostile_names_stay_text(calibration, picture):
    views = tuple(replace(view, view=view.view + HOSTILE) for view in calibration.residuals.views)
    hostile = example_calibration(
        views=views,
        method=HOSTILE,
        warnings=(HOSTILE,),
        provenance={HOSTILE: HOSTILE},
        light_planes=(replace(calibration.light_plane, name=HOSTILE),),
    )
    segments = tuple(replace(one, name=HOSTILE) for one in picture.segments)
    table = Table(HOSTILE, (HOSTILE,), ((HOSTILE,),), HOSTILE)
    plain = Table("a", ("b",), (("c",),), "d")
    attacked = Page(
        build_report(hostile, [replace(picture, name=HOSTILE, segments=segments)], [table])
    )
    benign = Page(build_report(replace(calibration, provenance={"a": "b"}), [picture], [plain]))
    assert attacked.tags == benign.tags
    assert [HOSTILE] in attacked.cells
    assert not [a for a in attacked.attributes if a[1].startswith("on")]
    shown = json.dumps(attacked.figures())
    assert "&lt;script&gt;" in shown
    assert "<script" not in shown


def test_a_report_without_pictures_tables_warnings_and_provenance(calibration):
    bare = Page(build_report(replace(calibration, warnings=(), provenance={})))
    words = " ".join(bare.text.split())
    assert "No warnings." in words
    assert "Nothing was recorded." in words
    assert "Measured pictures" not in words
    assert "Comparisons" not in words
    assert bare.tags["img"] == 0


@pytest.mark.parametrize(
    "views",
    [
        (ViewResiduals("plane", "v", np.ones((3, 2)), np.zeros((3, 2)), np.full((3, 3), 900.0)),),
        (ViewResiduals("camera", "v", *(np.full((3, n), np.nan) for n in (2, 2, 3))),),
    ],
    ids=["one view", "nothing seen"],
)
def test_sparse_views_make_a_page(views):
    page = Page(build_report(example_calibration(views=views)))
    assert f"1 {views[0].stage} view." in " ".join(page.text.split())
    assert len(page.figures()) == 6


def test_a_missing_marker_makes_no_invalid_number(calibration):
    """JSON has no NaN: gaps reach the figures as null or in binary form."""
    view = calibration.residuals.views[0]
    uv, residuals = view.uv.copy(), view.residuals.copy()
    uv[1] = residuals[1] = np.nan
    views = (replace(view, uv=uv, residuals=residuals), *calibration.residuals.views[1:])
    page = Page(build_report(example_calibration(views=views)))
    for attributes, text in page.raw:
        if attributes.get("type") == "application/json":
            json.loads(text, parse_constant=pytest.fail)
    assert "nan" not in page.text


def test_a_calibration_without_views_says_so():
    page = Page(build_report(facing_calibration(2000.0)))
    assert "This calibration carries no views." in page.text
    assert set(page.figures()) == {"figure-space", "figure-budget"}


def test_hostile_sources_and_components_stay_text():
    fine = calibration_of_two_lasers()
    sources = tuple(replace(one, name=HOSTILE + one.name) for one in fine.covariance.sources)
    names = tuple(HOSTILE + name for name in fine.covariance.components.names)
    components = replace(fine.covariance.components, names=names)
    covariance = replace(fine.covariance, sources=sources, components=components)
    attacked = Page(build_report(replace(fine, covariance=covariance)))
    assert attacked.tags["script"] == Page(build_report(fine)).tags["script"]
    assert attacked.tags["img"] == 0
    assert HOSTILE in attacked.text
    assert "<script" not in json.dumps(attacked.figures())


@pytest.fixture(scope="module")
def page_of_two() -> Page:
    return Page(build_report(calibration_of_two_lasers()))


def test_every_laser_has_its_numbers(page_of_two: Page):
    words = " ".join(page_of_two.text.split())
    for plane in calibration_of_two_lasers().light_planes:
        assert f"Sheet of light “{plane.name}”" in words
        assert f"A length of 100 mm in the sheet {plane.name} is known" in words
        assert f"{plane.name}: depth of the sheet there" in words
        assert f"{plane.distance_mm:.2f} mm" in words
        assert f"{plane.name}.nx" in words
    assert "8 camera views, 10 plane views and 8 crossing views" in words


def test_crossing_views_stand_in_the_table_of_residuals(page_of_two: Page):
    """The noise is the same in all stages; 24 markers and 4 spots tell it to some 20 % each."""
    rows = {row[0]: row[1:] for row in page_of_two.cells if row and row[0].startswith("crossing,")}
    assert {title: int(cells[0]) for title, cells in rows.items()} == {
        "crossing, markers": 8,
        "crossing, spots of left": 4,
        "crossing, spots of right": 4,
    }
    assert [int(cells[1]) for cells in rows.values()] == [24, 4, 4]
    for _, _, rms, largest in rows.values():
        assert 0.03 < float(rms) < 0.2
        assert float(rms) < float(largest) < 0.6


def test_no_number_of_the_page_is_missing(page_of_two: Page):
    assert not re.search(r"\bnan\b|\binf\b|None", page_of_two.text, re.IGNORECASE)
    for attributes, text in page_of_two.raw:
        if attributes.get("type") == "application/json":
            json.loads(text, parse_constant=pytest.fail)


def test_sources_have_the_names_that_the_file_gives_them(page_of_two: Page):
    """In both budgets, in the figure, and in the explanations; the length adds its own points."""
    headings = [row for row in page_of_two.cells if row and row[0] in ("Length", "Parameter")]
    assert [row[3:-2] for row in headings] == [[*SHARES, "image points"], list(SHARES)]
    drawn = page_of_two.figures()["figure-budget"]
    assert [trace["name"] for trace in drawn["data"]] == [*SHARES, "image points"]
    components = {"pixel", "placement", "marker", "target length", "temperature"}
    rows = [row for row in page_of_two.cells if len(row) == 7 and row[0] in components]
    assert {row[0] for row in rows} == components


def test_without_covariance_no_budget_is_made_up(picture):
    page = Page(build_report(example_calibration(covariance=NO_COVARIANCE), [picture]))
    assert "figure-budget" not in page.figures()
    assert [row for row in page.cells if row[0] == "bar-1" and "not given" in row]


def test_warnings_stand_above_everything_else(calibration, picture, text: str):
    assert text.index("Few views reach into the corners") < text.index('class="card"')
