"""``calibration.json``: exact round trips, and files that are no calibration."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.calibration_json import (
    calibration_text,
    read_calibration,
    write_calibration,
)
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.covariance import Covariance, NoiseComponents, Source
from sheetoflight.model.diagnosis import Finding
from sheetoflight.model.light_plane import LightPlane

Change = Callable[[dict[str, Any]], object]
DIRECTIONS = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: math.hypot(*n) > 1e-3)


def test_the_keys_are_those_of_the_contract(calibration: Calibration):
    document = json.loads(calibration_text(calibration))
    assert list(document) == [
        *("format", "version", "method", "camera", "light_planes", "target", "pixel_std"),
        *("covariance", "residuals", "warnings", "provenance"),
    ]
    assert document["format"] == "sheetoflight.calibration"
    assert document["version"] == 1
    assert list(document["camera"]) == ["image_size", "matrix", "distortion"]
    assert document["camera"]["matrix"] == calibration.camera.matrix.tolist()
    assert list(document["light_planes"][0]) == ["name", "normal", "distance_mm"]
    assert list(document["covariance"]) == ["parameters", "matrix"]
    assert list(document["residuals"]) == ["rms_px", "chi2_per_dof", "views"]


def test_every_number_comes_back_exactly(tmp_path: Path, calibration: Calibration):
    path = tmp_path / "calibration.json"
    write_calibration(path, calibration)
    back = read_calibration(path)
    for name in ("method", "camera", "target", "pixel_std", "warnings", "provenance"):
        assert getattr(back, name) == getattr(calibration, name)
    (plane,), (before,) = back.light_planes, calibration.light_planes
    assert (plane.name, plane.distance_mm) == (before.name, before.distance_mm)
    np.testing.assert_array_equal(plane.normal, before.normal)
    assert back.covariance.parameters == calibration.covariance.parameters
    np.testing.assert_array_equal(back.covariance.matrix, calibration.covariance.matrix)
    assert back.residuals.rms_px == calibration.residuals.rms_px
    assert back.residuals.chi2_per_dof == calibration.residuals.chi2_per_dof
    for view, was in zip(back.residuals.views, calibration.residuals.views, strict=True):
        assert (view.stage, view.view) == (was.stage, was.view)
        for name in ("uv", "residuals", "xyz"):
            np.testing.assert_array_equal(getattr(view, name), getattr(was, name))


def test_what_is_read_is_written_with_the_same_bytes(tmp_path: Path, calibration: Calibration):
    write_calibration(tmp_path / "first.json", calibration)
    write_calibration(tmp_path / "second.json", read_calibration(tmp_path / "first.json"))
    assert (tmp_path / "first.json").read_bytes() == (tmp_path / "second.json").read_bytes()


FINDINGS = (
    Finding("target", "bent target", "bent by 0.1 ± 0.02 mm", "straighten it", 1 / 3, 1e-9, 0.7),
    Finding("plane", "noisy stage", "scatters 3 times as much", "focus", 0.0, 0.0),
)


def test_findings_come_back_exactly(tmp_path: Path, calibration: Calibration):
    told = replace(calibration, findings=FINDINGS)
    write_calibration(tmp_path / "c.json", told)
    assert read_calibration(tmp_path / "c.json").findings == FINDINGS
    write_calibration(tmp_path / "d.json", read_calibration(tmp_path / "c.json"))
    assert (tmp_path / "c.json").read_bytes() == (tmp_path / "d.json").read_bytes()


@pytest.mark.parametrize(
    ("key", "value"), [("explained", 1.2), ("odds", -1e-9), ("shift", -1), ("text", "")], ids=str
)
def test_findings_that_are_none_are_named_with_their_key(
    tmp_path: Path, calibration: Calibration, key: str, value: object
):
    document = json.loads(calibration_text(replace(calibration, findings=FINDINGS)))
    document["findings"][1][key] = value
    (tmp_path / "c.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=rf"c.json: findings\[1\].{key} is "):
        read_calibration(tmp_path / "c.json")


def test_where_the_covariance_comes_from_comes_back_exactly(tmp_path: Path, explained: Calibration):
    write_calibration(tmp_path / "first.json", explained)
    back = read_calibration(tmp_path / "first.json")
    assert back.target == explained.target
    for plane, before in zip(back.light_planes, explained.light_planes, strict=True):
        assert (plane.name, plane.distance_mm) == (before.name, before.distance_mm)
        np.testing.assert_array_equal(plane.normal, before.normal)
    for source, was in zip(back.covariance.sources, explained.covariance.sources, strict=True):
        assert (source.name, source.component) == (was.name, was.component)
        np.testing.assert_array_equal(source.matrix, was.matrix)
    noise, was = back.covariance.components, explained.covariance.components
    assert (noise.names, noise.std) == (was.names, was.std)
    np.testing.assert_array_equal(noise.relative_covariance, was.relative_covariance)
    assert back.residuals.views[-1].uv.shape == (5, 2)
    write_calibration(tmp_path / "second.json", back)
    assert (tmp_path / "first.json").read_bytes() == (tmp_path / "second.json").read_bytes()


FACTORS = st.just(0.0) | st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6)


@settings(max_examples=40)
@given(st.data())
def test_any_sources_come_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, calibration: Calibration, data: st.DataObject
):
    """Shares of any size and rank; whatever their sum is rounded to is read again."""
    size, count = data.draw(st.integers(1, 4)), data.draw(st.integers(1, 4))
    ranks = st.integers(1, 4)
    factors = [data.draw(hnp.arrays(float, (size, data.draw(ranks)), elements=FACTORS))
               for _ in range(count)]  # fmt: skip
    shares = [factor @ factor.T for factor in factors]
    shares = [(share + share.T) / 2 for share in shares]
    components = data.draw(st.lists(st.none() | st.just("pixel"), min_size=count, max_size=count))
    covariance = Covariance(
        tuple(f"p{i}" for i in range(size)),
        np.sum(shares, axis=0),
        tuple(
            Source(f"s{i}", *pair) for i, pair in enumerate(zip(shares, components, strict=True))
        ),
        NoiseComponents(("pixel",), (0.1,), np.array([[data.draw(st.floats(0, 2))]])),
    )
    path = tmp_path_factory.getbasetemp() / "sources.json"
    write_calibration(path, replace(calibration, covariance=covariance))
    back = read_calibration(path).covariance
    for source, was in zip(back.sources, covariance.sources, strict=True):
        assert (source.name, source.component) == (was.name, was.component)
        np.testing.assert_array_equal(source.matrix, was.matrix)
    np.testing.assert_array_equal(
        back.components.relative_covariance, covariance.components.relative_covariance
    )


def test_a_share_may_miss_zero_by_a_rounding_error_of_the_whole(
    tmp_path: Path, calibration: Calibration
):
    """Where a source says nothing of a parameter, arithmetic leaves ±1e-16 of its variance."""
    shares = np.array([[[4.0, 1e-16], [1e-16, -1e-16]], [[0.0, -1e-16], [-1e-16, 9.0]]])
    sources = tuple(Source("sheet", share) for share in shares)
    covariance = Covariance(("a", "b"), np.diag([4.0, 9.0]), sources)
    write_calibration(tmp_path / "c.json", replace(calibration, covariance=covariance))
    back = read_calibration(tmp_path / "c.json").covariance
    assert [source.matrix.tolist() for source in back.sources] == shares.tolist()


def test_what_is_not_known_of_a_covariance_is_left_out_and_may_be_missing(
    tmp_path: Path, explained: Calibration
):
    document = json.loads(calibration_text(explained))
    keys = ("expansion_per_K", "warmer_by_K", "warmer_by_std_K", "expansion_std_per_K")
    for key in keys:
        del document["target"][key]
    for key in ("sources", "noise"):
        del document["covariance"][key]
    (tmp_path / "c.json").write_text(json.dumps(document))
    back = read_calibration(tmp_path / "c.json")
    assert [getattr(back.target, key) for key in keys] == [0.0] * 4
    assert (back.covariance.sources, back.covariance.components.names) == ((), ())
    assert list(json.loads(calibration_text(back))["covariance"]) == ["parameters", "matrix"]


@settings(max_examples=60)
@given(DIRECTIONS, st.floats(1e-3, 1e6))
def test_every_light_plane_comes_back_to_the_last_digit(
    tmp_path_factory: pytest.TempPathFactory,
    calibration: Calibration,
    normal: tuple[float, float, float],
    distance: float,
):
    path = tmp_path_factory.getbasetemp() / "plane.json"
    plane = LightPlane(np.array(normal), distance)
    write_calibration(path, replace(calibration, light_planes=(plane,)))
    back = read_calibration(path).light_plane
    np.testing.assert_array_equal(back.normal, plane.normal)
    assert back.distance_mm == distance
    with pytest.raises(ValueError, match="read-only"):
        back.normal[0] = 0


def test_a_marker_that_was_not_seen_is_null(calibration: Calibration):
    document = json.loads(calibration_text(calibration))
    seen, unseen = document["residuals"]["views"]
    assert None not in seen["uv"]
    assert [entry is None for entry in unseen["uv"]] == [False, True, False]
    assert [entry is None for entry in unseen["residuals"]] == [False, True, False]
    assert unseen["rms_px"] == calibration.residuals.views[1].rms_px


def test_a_calibration_without_covariance_and_views_comes_back(
    tmp_path: Path, calibration: Calibration
):
    bare = replace(
        calibration,
        covariance=Covariance((), np.empty((0, 0))),
        residuals=Residuals(0.1, 1.0),
        provenance={},
    )
    write_calibration(tmp_path / "bare.json", bare)
    back = read_calibration(tmp_path / "bare.json")
    assert back.covariance.matrix.shape == (0, 0)
    assert (back.residuals.rms_px, back.residuals.chi2_per_dof) == (0.1, 1.0)
    assert back.residuals.views == ()


def test_keys_that_others_add_are_ignored(tmp_path: Path, calibration: Calibration):
    document = json.loads(calibration_text(calibration))
    document["notes"] = {"by": "us"}
    document["camera"]["serial"] = 17
    (tmp_path / "more.json").write_text(json.dumps(document))
    assert calibration_text(read_calibration(tmp_path / "more.json")) == calibration_text(
        calibration
    )


def test_a_normal_with_few_digits_is_scaled_to_length_one(tmp_path: Path, calibration: Calibration):
    document = json.loads(calibration_text(calibration))
    document["light_planes"][0]["normal"] = [0.6000003, 0.8, 0.0]
    (tmp_path / "short.json").write_text(json.dumps(document))
    normal = read_calibration(tmp_path / "short.json").light_plane.normal
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-15)


def test_numbers_that_are_none_are_not_written(tmp_path: Path, calibration: Calibration):
    broken = replace(calibration, residuals=Residuals(math.nan, 1.0))
    with pytest.raises(InputError, match=r"c.json: residuals.rms_px is nan, which JSON cannot"):
        write_calibration(tmp_path / "c.json", broken)
    with pytest.raises(InputError, match=r"provenance.when is of type object"):
        calibration_text(replace(calibration, provenance={"when": object()}))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("place", ["std", "source", "view"])
def test_nothing_that_is_no_number_is_written_anywhere(
    tmp_path: Path, explained: Calibration, place: str
):
    covariance, views = explained.covariance, explained.residuals.views
    if place == "std":
        noise = replace(covariance.components, std=(0.1, math.nan))
        broken = replace(explained, covariance=replace(covariance, components=noise))
    elif place == "source":
        source = replace(covariance.sources[0], matrix=np.array(covariance.sources[0].matrix))
        sources = (source, *covariance.sources[1:])
        broken = replace(explained, covariance=replace(covariance, sources=sources))
        source.matrix[0, 0] = math.nan
    else:
        view = replace(views[-1], xyz=np.full((5, 3), math.inf))
        broken = replace(explained, residuals=replace(explained.residuals, views=(view,)))
    with pytest.raises(InputError, match="which JSON cannot say"):
        write_calibration(tmp_path / "c.json", broken)
    assert list(tmp_path.iterdir()) == []
    assert "NaN" not in calibration_text(explained)


def _set(*keys: str | int, to: object) -> Change:
    def change(document: dict[str, Any]) -> None:
        place: Any = document
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = to

    return change


def _drop(*keys: str | int) -> Change:
    def change(document: dict[str, Any]) -> None:
        place: Any = document
        for key in keys[:-1]:
            place = place[key]
        del place[keys[-1]]

    return change


def _indefinite(document: dict[str, Any]) -> None:
    matrix = np.array(document["covariance"]["matrix"])
    matrix[0, 1] = matrix[1, 0] = 1.01 * math.sqrt(matrix[0, 0] * matrix[1, 1])
    document["covariance"]["matrix"] = matrix.tolist()


def _certain_but_correlated(document: dict[str, Any]) -> None:
    document["covariance"] = {"parameters": ["a", "b"], "matrix": [[0, 1e-9], [1e-9, 1]]}


def _share(to: Callable[[np.ndarray], np.ndarray], source: int = 0) -> Change:
    def change(document: dict[str, Any]) -> None:
        part = document["covariance"]["sources"][source]
        part["matrix"] = to(np.array(part["matrix"])).tolist()

    return change


def _moved_between_shares(document: dict[str, Any]) -> None:
    """The sum stays, one share becomes indefinite."""
    first, second = document["covariance"]["sources"][:2]
    whole = np.array(document["covariance"]["matrix"])
    shift = np.zeros_like(whole)
    shift[0, 0] = 0.5 * whole[0, 0]
    shift[0, 1] = shift[1, 0] = 0.9 * math.sqrt(whole[0, 0] * whole[1, 1])
    first["matrix"] = shift.tolist()
    second["matrix"] = (whole - shift).tolist()


def _second_plane(document: dict[str, Any]) -> None:
    document["light_planes"] *= 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_set("format", to="mrcal"), "format is 'mrcal', expected 'sheetoflight.calibration'"),
        (_drop("format"), "format is missing, expected"),
        (_set("version", to=2), "version is 2, expected 1 – calibrate again"),
        (_set("version", to=True), "version is true, expected 1"),
        (_drop("version"), "version is missing, expected 1"),
        (_drop("camera"), "'camera' is missing"),
        (_drop("camera", "matrix"), "camera: 'matrix' or 'distortion' is missing"),
        (_drop("target", "markers_mm"), "target: 'markers_mm' is missing"),
        (_set("method", to=7), "method is 7, expected text in quotes"),
        (_set("camera", "matrix", 0, 1, to="x"), r"camera.matrix\[0\]\[1\] is 'x', expected a num"),
        (_set("camera", "matrix", 0, to=[1, 2]), r"camera.matrix\[0\] is a list of 2, expected 3 "),
        (_set("camera", "matrix", 1, 0, to=1), "camera: the camera matrix is"),
        (_set("camera", "matrix", 0, 0, to=-5), "camera: the focal lengths are -5.0 and"),
        (_set("camera", "matrix", 0, 0, to=10**400), r"camera.matrix\[0\]\[0\] is a number of too"),
        (
            _set("camera", "image_size", to=[0, 5]),
            r"camera.image_size\[0\] is 0, expected a number",
        ),
        (
            _set("camera", "distortion", to=[0.1]),
            "camera.distortion is a list of 1, expected 5 ent",
        ),
        (_set("light_planes", to=None), "'light_planes' is missing"),
        (
            _set("light_planes", 0, "normal", to=[0.6, 0.8, 0.1]),
            r"light_planes\[0\].normal has leng",
        ),
        (_set("light_planes", 0, "normal", to=[0, 0, 0]), r"light_planes\[0\].normal has length 0"),
        (
            _set("light_planes", 0, "distance_mm", to=-5),
            r"light_planes\[0\]: light plane 'laser' ha",
        ),
        (_second_plane, "light_planes: two planes share a name: laser, laser"),
        (_set("target", "markers_mm", to=[0, 1]), "target: the target has 2 markers"),
        (_set("pixel_std", to=-0.1), "pixel_std is -0.1, expected a number of 0 or more"),
        (
            _set("covariance", "parameters", 1, to="camera.alpha"),
            "covariance.parameters names 'cam",
        ),
        (_drop("covariance", "matrix", 2), "covariance.matrix does not have 14 rows of 14 numbers"),
        (
            _drop("covariance", "matrix", 2, 3),
            "covariance.matrix does not have 14 rows of 14",
        ),
        (
            _set("covariance", "matrix", 0, 1, to=9e9),
            r"covariance.matrix is not symmetric: \[0\]\[1",
        ),
        (
            _set("covariance", "matrix", 3, 3, to=-1.0),
            r"covariance.matrix\[3\]\[3\], the variance o",
        ),
        (_indefinite, "covariance.matrix is not positive semi-definite"),
        (_certain_but_correlated, "covariance.matrix is not positive semi"),
        (
            _drop("residuals", "views", 0, "xyz", 0),
            r"residuals.views\[0\] has 3 uv, 3 residuals and",
        ),
        (
            _set("residuals", "views", 1, "uv", 0, to=[1]),
            r"residuals.views\[1\].uv\[0\] is a list o",
        ),
        (_set("residuals", "rms_px", to=None), "residuals.rms_px is None, expected a number"),
        (_set("warnings", to="none"), "warnings is 'none', expected a list"),
        (_set("provenance", to=[]), "provenance is a list of 0, expected a table"),
    ],
    ids=lambda value: value[:60].replace("\\", "") if isinstance(value, str) else "",
)
def test_what_is_no_calibration_is_named_with_its_key(
    tmp_path: Path, calibration: Calibration, change: Change, message: str
):
    document = copy.deepcopy(json.loads(calibration_text(calibration)))
    change(document)
    (tmp_path / "c.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=f"c.json: {message}") as caught:
        read_calibration(tmp_path / "c.json")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_share(lambda m: m[1:]), r"covariance.sources\[0\].matrix does not have 18 rows of 18"),
        (
            _share(lambda m: -m, 1),
            r"covariance.sources\[1\].matrix\[0\]\[0\], the variance of camera",
        ),
        (
            _share(lambda m: m * 1e4, 2),
            r"covariance.sources\[2\].matrix is larger than covariance.m",
        ),
        (
            _share(np.triu),
            r"covariance.sources\[0\].matrix is not symmetric: \[0\]\[1",
        ),
        (
            _share(lambda m: m * 0.99),
            "covariance.sources do not add up to covariance.matrix: for ca",
        ),
        (_drop("covariance", "sources", 1), "covariance.sources do not add up to covariance.matri"),
        (_moved_between_shares, r"covariance.sources\[0\].matrix is not positive semi-definite"),
        (
            _set("covariance", "sources", 0, "component", to="marker"),
            r"covariance.sources\[0\].component is 'marker', which covariance.noise does not name",
        ),
        (_drop("covariance", "noise"), r"covariance.sources\[0\].component is 'pixel', which"),
        (_drop("covariance", "sources", 0, "name"), r"covariance.sources\[0\]: 'name' is missing"),
        (_drop("covariance", "noise", "std", 1), "covariance.noise.std has 1 entries for 2 compon"),
        (
            _set("covariance", "noise", "std", 0, to=-1),
            r"covariance.noise.std\[0\] is -1, expected",
        ),
        (
            _set("covariance", "noise", "components", to=["pixel", "pixel"]),
            "covariance.noise.components names 'pixel' twice",
        ),
        (
            _set("covariance", "noise", "relative_covariance", to=[[0.2]]),
            "covariance.noise.relative_covariance does not have 2 rows of 2 numbers",
        ),
        (
            _set("covariance", "noise", "relative_covariance", to=[[0.2, 1], [1, 0.7]]),
            "covariance.noise.relative_covariance is not positive semi-definite",
        ),
        (_set("target", "expansion_per_K", to=-1), "target: expansion_per_K is -1"),
        (_set("light_planes", 1, "name", to="left"), "light_planes: two planes share a name"),
    ],
    ids=lambda value: value[:60].replace("\\", "") if isinstance(value, str) else "",
)
def test_sources_that_are_none_are_named_with_their_key(
    tmp_path: Path, explained: Calibration, change: Change, message: str
):
    document = json.loads(calibration_text(explained))
    change(document)
    (tmp_path / "c.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=f"c.json: {message}") as caught:
        read_calibration(tmp_path / "c.json")
    assert "\n" not in str(caught.value)


def test_a_number_too_large_for_a_float_is_named(tmp_path: Path, calibration: Calibration):
    text = calibration_text(calibration).replace('"distance_mm": 562.334', '"distance_mm": 1e999')
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(InputError, match=r"light_planes\[0\].distance_mm is inf, expected a fin"):
        read_calibration(tmp_path / "c.json")


def test_a_file_cut_short_is_no_calibration(tmp_path: Path, calibration: Calibration):
    text = calibration_text(calibration)
    for length in range(0, len(text) - 2, 97):
        (tmp_path / "c.json").write_text(text[:length])
        with pytest.raises(FileError, match=r"c.json (is empty|line \d+ column \d+ is not JSON)"):
            read_calibration(tmp_path / "c.json")


def test_a_file_with_the_documented_keys_alone_is_read(
    tmp_path: Path, calibration: Calibration
) -> None:
    document = json.loads(calibration_text(calibration))
    for key in ("target", "pixel_std", "warnings"):
        del document[key]
    document["residuals"]["views"] = [{"view": "07", "rms_px": 0.1}]
    (tmp_path / "c.json").write_text(json.dumps(document))
    again = read_calibration(tmp_path / "c.json")
    assert again.camera == calibration.camera
    assert again.pixel_std == calibration.residuals.rms_px
    assert again.target is None
    write_calibration(tmp_path / "d.json", again)
    assert read_calibration(tmp_path / "d.json").target is None
