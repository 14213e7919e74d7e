"""Means of residuals: they show what neighbours have in common, and how much chance would."""

from __future__ import annotations

from collections import defaultdict
from typing import Any, cast

import numpy as np
import pytest

from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.report.mean_residuals import mean_residuals, residual_means
from sheetoflight.report.page import build_report
from tests.report.board_examples import camera_calibration
from tests.report.test_page import Page

WIDTH, HEIGHT = 1392, 1040


def scattered(residuals: np.ndarray) -> Calibration:
    """Points all over the picture with given residuals, a hundred in a view."""
    rng = np.random.default_rng(20111201)
    uv = rng.uniform((0.0, 0.0), (WIDTH - 1.0, HEIGHT - 1.0), size=residuals.shape)
    xyz = np.full((100, 3), 500.0)
    views = tuple(
        ViewResiduals("board", f"v{i}", *parts, xyz)
        for i, parts in enumerate(
            zip(uv.reshape(-1, 100, 2), residuals.reshape(-1, 100, 2), strict=True)
        )
    )
    return camera_calibration(residuals=Residuals(0.1, 1.0, views))


def test_means_are_those_of_every_square():
    rng = np.random.default_rng(20111202)
    calibration = scattered(rng.normal(scale=0.1, size=(1000, 2)))
    side = WIDTH / 12
    squares = defaultdict(list)
    for view in calibration.residuals.views:
        for (u, v), residual in zip(view.uv, view.residuals, strict=True):
            squares[int((u + 0.5) / side), int((v + 0.5) / side)].append(((u, v), residual))
    full = {key: points for key, points in squares.items() if len(points) >= 8}
    assert len(full) < len(squares)
    found = mean_residuals(calibration)
    means = {(int((u + 0.5) / side), int((v + 0.5) / side)): i for i, (u, v) in enumerate(found.uv)}
    assert set(means) == set(full)
    for key, points in full.items():
        place = means[key]
        assert found.counts[place] == len(points)
        assert found.uv[place] == pytest.approx(np.mean([uv for uv, _ in points], axis=0))
        assert found.residuals[place] == pytest.approx(np.mean([r for _, r in points], axis=0))


def test_noise_alone_leaves_one_in_twenty_outside():
    """Of some 1000 squares 50 ± 7; beyond five of these lies chance once in a million."""
    rng = np.random.default_rng(20111203)
    outside = total = 0
    for _ in range(10):
        found = mean_residuals(scattered(rng.normal(scale=0.2, size=(3000, 2))))
        outside += int((np.hypot(*found.residuals.T) > found.reach_px).sum())
        total += len(found.counts)
    assert total > 900
    assert abs(outside - 0.05 * total) < 5 * np.sqrt(0.05 * 0.95 * total)


def test_what_neighbours_share_is_drawn_true_to_the_stated_factor():
    common = np.array([0.3, -0.1])
    figure = residual_means(scattered(np.tile(common, (1000, 1))))
    circles, shafts, dots = cast("Any", figure).data
    factor = float(figure.layout.xaxis.title.text.split()[-2])
    lines = np.column_stack([shafts.x, shafts.y]).reshape(-1, 3, 2)
    assert lines[:, 1] - lines[:, 0] == pytest.approx(np.tile(factor * common, (len(lines), 1)))
    assert lines[:, 0] == pytest.approx(np.column_stack([dots.x, dots.y]))
    rings = np.column_stack([circles.x, circles.y]).reshape(len(lines), -1, 2)[:, :-1]
    radii = np.linalg.norm(rings - lines[:, :1], axis=2)
    root = np.sqrt(np.mean(common**2))
    counts = dots.customdata[:, 2]
    expected = factor * root * np.sqrt(-2 * np.log(0.05) / counts)
    assert radii == pytest.approx(np.tile(expected[:, None], (1, radii.shape[1])))


@pytest.mark.parametrize(
    ("views", "drawn"),
    [
        (4, {"figure-residual-arrows"}),
        (6, {"figure-residual-arrows", "figure-residual-means"}),
        (29, {"figure-residual-means"}),
    ],
)
def test_many_points_are_drawn_as_means(views: int, drawn: set[str]):
    page = Page(build_report(camera_calibration(views)))
    both = {"figure-residual-arrows", "figure-residual-means"}
    assert set(page.figures()) & both == drawn


def test_nothing_seen_has_no_means():
    gone = np.full((100, 2), np.nan)
    view = ViewResiduals("board", "v", gone, gone, np.ones((100, 3)))
    calibration = camera_calibration(residuals=Residuals(0.0, 1.0, (view,)))
    assert not len(mean_residuals(calibration).counts)
    assert "enlarged 1 times" in residual_means(calibration).layout.xaxis.title.text
