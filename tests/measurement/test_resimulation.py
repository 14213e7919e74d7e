"""A rig simulated again: what moves, by how much, and together with what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.resimulation import Resimulation, resimulation
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig
from tests.calibration.examples import simulated

DRAWS = 400
CHANCE = 4.5
"""Standard errors that a sample variance may lie off; one of a hundred does so with odds 7e-4."""


def quiet(source: Resimulation, **sizes: float) -> Resimulation:
    """Without noise in the image; other noise as given."""
    truth = {stage: replace(one, std=0.0 * one.std) for stage, one in source.truth.items()}
    return replace(source, truth=truth, sizes={"placement": 0.0, "marker": 0.0} | sizes)


def crossed(target: CollinearTarget | None = None) -> Resimulation:
    """A rig with views of all stages, calibrated."""
    truth = paper_rig(target=target)
    rng = np.random.default_rng(4)
    views = observed_rig(truth, 12, 6, 0.1, rng, crossing_views=6)
    rig = Rig(truth.target, truth.camera.image_size, pixel_std=0.1, observations=views)
    return resimulation(rig, calibrate(rig))


def off_sheet(source: Resimulation, uv: Array) -> Array:
    """Offsets ``(N, M)`` from the sheet in mm that explain image points, by a difference
    quotient of the projection."""
    true = source.truth["plane"]
    base, step = source.camera.project(true.points), 1e-4
    motion = (source.camera.project(true.points + step * true.off[:, None]) - base) / step
    return np.sum((uv - base) * motion, axis=-1) / np.sum(motion**2, axis=-1)


def test_without_noise_the_image_points_are_the_fitted_ones() -> None:
    _, rig = simulated(views=(12, 6), stated=True)
    calibration = calibrate(rig)
    drawn = quiet(resimulation(rig, calibration)).drawn(np.random.default_rng(0))
    stages = drawn.observations.stages()
    for view in calibration.residuals.views:
        views = stages[view.stage]
        uv = views.uv[views.names.index(view.view)]
        assert uv == pytest.approx(view.uv - view.residuals, abs=1e-9)


def test_the_noise_has_the_estimated_size_in_the_stated_proportions() -> None:
    _, rig = simulated(views=(12, 6))
    old = rig.observations.camera
    std = np.ones(old.uv.shape[:2])
    std[:, 1] = 3.0
    views = Observations(TargetViews(old.names, old.uv, std), rig.observations.plane)
    rig = replace(rig, observations=views)
    calibration = calibrate(rig)
    source = resimulation(rig, calibration)
    rng = np.random.default_rng(0)
    uv = np.array([source.drawn(rng).observations.camera.uv for _ in range(DRAWS)])
    spread = uv.var(axis=0, ddof=1).mean(axis=(0, 2))
    # points without a std of their own count as typical ones
    typical = (24 * 1.0 + 12 * 9.0) / 36
    expected = calibration.pixel_std**2 * np.array([1.0, 9.0, 1.0]) / typical
    assert spread == pytest.approx(expected, rel=CHANCE * np.sqrt(2 / (DRAWS * 12 * 2)))


def test_a_rods_ends_lie_off_the_sheet_independently_and_it_stays_straight() -> None:
    source = quiet(crossed(), placement=0.2)
    rng = np.random.default_rng(1)
    off = np.concatenate(
        [off_sheet(source, source.drawn(rng).observations.plane.uv) for _ in range(DRAWS)]
    )
    assert off[:, 1] == pytest.approx(off[:, [0, 2]].mean(axis=1), abs=2e-3)
    chance = CHANCE * 0.2**2 * np.sqrt(2 / len(off))
    expected = 0.2**2 * np.array([[1, 0.5, 0], [0.5, 0.5, 0.5], [0, 0.5, 1]])
    assert np.cov(off.T) == pytest.approx(expected, abs=chance)


def test_single_markers_lie_off_the_sheet_independently() -> None:
    source = quiet(crossed(), marker=0.2)
    rng = np.random.default_rng(2)
    off = np.concatenate(
        [off_sheet(source, source.drawn(rng).observations.plane.uv) for _ in range(DRAWS)]
    )
    chance = CHANCE * 0.2**2 * np.sqrt(2 / len(off))
    assert np.cov(off.T) == pytest.approx(0.2**2 * np.eye(3), abs=chance)


def test_a_targets_tolerance_moves_its_markers_alike_in_all_views_and_no_spot() -> None:
    source = quiet(crossed(CollinearTarget(tolerance_mm=0.5)))
    drawn = source.drawn(np.random.default_rng(3)).observations
    shifts = []
    for stage, views in drawn.stages().items():
        true = source.truth[stage]
        base, step = source.camera.project(true.points[:, :3]), 1e-4
        moved = source.camera.project(true.points[:, :3] + step * true.along[:, None])
        motion = (moved - base) / step
        shift = np.sum((views.uv[:, :3] - base) * motion, axis=-1) / np.sum(motion**2, axis=-1)
        shifts.append(shift)
    every = np.concatenate(shifts)
    assert every.std(axis=0) == pytest.approx(np.zeros(3), abs=0.02)  # second order
    assert np.abs(every.mean(axis=0)).max() > 0.1
    spots = source.camera.project(source.truth["crossing"].points[:, 3])
    assert drawn.crossing.uv[:, 3] == pytest.approx(spots)


def test_an_unknown_temperature_scales_the_target() -> None:
    target = CollinearTarget((0.0, 100.0, 400.0), 0.0, expansion_per_K=1e-3, warmer_by_std_K=5.0)
    source = quiet(crossed(target))
    rng = np.random.default_rng(5)
    shifts = np.array([source._marker_shifts(rng) for _ in range(DRAWS)])
    assert shifts[:, 1] == pytest.approx(shifts[:, 2] / 4)
    assert shifts[:, 2].std() == pytest.approx(400 * 5e-3, rel=CHANCE / np.sqrt(2 * DRAWS))


def test_what_was_not_seen_or_not_used_stays_away() -> None:
    _, rig = simulated(views=(12, 6), stated=True)
    uv = np.array(rig.observations.camera.uv)
    uv[3, 1] = np.nan
    views = TargetViews(rig.observations.camera.names, uv)
    rig = replace(rig, observations=Observations(views, rig.observations.plane))
    calibration = calibrate(rig)
    kept = tuple(v for v in calibration.residuals.views if v.view != "plane02")
    some = replace(calibration, residuals=replace(calibration.residuals, views=kept))
    drawn = resimulation(rig, some).drawn(np.random.default_rng(0)).observations
    assert np.array_equal(drawn.camera.seen, views.seen)
    assert "plane02" not in drawn.plane.names
    assert len(drawn.plane) == 5


def test_another_rigs_calibration_is_refused() -> None:
    _, rig = simulated(views=(12, 6), stated=True)
    calibration = calibrate(rig)
    other = replace(calibration, residuals=replace(calibration.residuals, views=()))
    with pytest.raises(InputError, match="no view of the rig"):
        resimulation(rig, other)
