"""Breakdown: a fifth of the markers and a tenth of the views wrong, and the result still right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import SheetOfLightError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.observations import Observations, TargetViews
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.poses import Recording, recorded
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

RECORDING = Recording(30, 10, pixel_std=0.1)
WRONG_MARKERS, WRONG_VIEWS = 0.2, 0.1
GROSS_PX = (3.0, 60.0)
NOISE_LIMIT = 6.0
"""Standard deviations, of a residual's length: 120 markers of noise stay below with odds of
1 - 2e-6. What is as near as that to where the others put it does no harm."""

Wrong = dict[str, np.ndarray]


def rig_of(kind: str, seed: int) -> SimulatedRig:
    """The paper's rig, or a random one with five or more markers."""
    if kind == "paper":
        return paper_rig()
    rng = np.random.default_rng([seed, 7])
    while len((rig := random_rig(rng)).target.positions) < 5:
        pass
    return rig


def spoilt(views: TargetViews, rng: np.random.Generator) -> tuple[TargetViews, np.ndarray]:
    """Views of which some markers, and some views as a whole, are wrong, and which ``(N, M)``."""
    uv, count, markers = views.uv.copy(), *views.uv.shape[:2]
    wrong = np.zeros((count, markers), dtype=bool)
    chosen = rng.choice(wrong.size, round(WRONG_MARKERS * wrong.size), replace=False)
    wrong.flat[chosen] = True
    angle, size = rng.uniform(0.0, 2.0 * np.pi, len(chosen)), rng.uniform(*GROSS_PX, len(chosen))
    uv[wrong] += size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for view in rng.choice(count, round(WRONG_VIEWS * count), replace=False):
        scattered = uv[view] + rng.uniform(-100.0, 100.0, 2) + rng.normal(0.0, 20.0, (markers, 2))
        uv[view] = uv[view, ::-1] if rng.random() < 0.3 else scattered
        wrong[view] = True
    return TargetViews(views.names, uv, laser=views.laser), wrong


def trial(kind: str, seed: int) -> tuple[SimulatedRig, Rig, Wrong]:
    truth, rng = rig_of(kind, seed), np.random.default_rng([seed, 8])
    right = recorded(truth, RECORDING, rng)
    camera, wrong_camera = spoilt(right.camera, rng)
    plane, wrong_plane = spoilt(right.plane, rng)
    rig = Rig(truth.target, truth.camera.image_size, observations=Observations(camera, plane))
    return truth, rig, {"camera": wrong_camera, "plane": wrong_plane}


def kept(found: Calibration, rig: Rig) -> Wrong:
    """Markers ``(N, M)`` of each stage that took part."""
    masks = {stage: np.zeros(v.seen.shape, dtype=bool) for stage, v in _stages(rig).items()}
    for view in found.residuals.views:
        names = _stages(rig)[view.stage].names
        masks[view.stage][names.index(view.view)] = np.isfinite(view.residuals).all(axis=1)
    return masks


def _stages(rig: Rig) -> dict[str, TargetViews]:
    return rig.observations.stages()


def largest_residual(found: Calibration) -> float:
    """Of all markers that took part, px."""
    every = np.concatenate([view.residuals for view in found.residuals.views])
    return float(np.nanmax(np.linalg.norm(every, axis=1)))


def off(found: Calibration, truth: SimulatedRig) -> Array:
    """Errors of the focal lengths, the principal point and the sheet's distance in standard
    uncertainties."""
    names = ("alpha", "beta", "u0", "v0")
    errors = [
        (getattr(found.camera, name) - getattr(truth.camera, name))
        / found.covariance.std(f"camera.{name}")
        for name in names
    ]
    distance = found.light_plane.distance_mm - truth.light_plane.distance_mm
    return np.array([*errors, distance / found.covariance.std("laser.d")])


def check(kind: str, seed: int) -> Array:
    """Nothing wrong is left in that is seen as wrong; the errors for statistics."""
    truth, rig, wrong = trial(kind, seed)
    found = calibrate(rig)
    assert largest_residual(found) < NOISE_LIMIT * RECORDING.pixel_std, (kind, seed)
    left_out = {stage: ~mask for stage, mask in kept(found, rig).items()}
    for stage, mask in left_out.items():
        # of views that are right, little is lost
        whole = ~wrong[stage].any(axis=1)
        assert mask[whole].mean() <= 0.05, (kind, seed, stage)
    return off(found, truth)


@pytest.mark.parametrize("kind", ["paper", "random"])
@pytest.mark.parametrize("seed", range(2))
def test_gross_errors_do_not_reach_the_estimates(kind: str, seed: int) -> None:
    """Five errors stay below four standard uncertainties with odds of 1 - 3e-4."""
    assert (np.abs(check(kind, seed)) < 4.0).all()


@pytest.mark.accuracy
@pytest.mark.parametrize("kind", ["paper", "random"])
def test_gross_errors_do_not_reach_the_estimates_of_100_rigs(kind: str) -> None:
    """At most one rig in twenty is refused, which is no wrong number; with it goes none of the
    statistics. 500 errors: one is beyond 4.9 standard uncertainties with odds of 5e-4; their
    mean square is 1, within four of its standard errors where a rig's five count as one."""
    found, refused = [], []
    for seed in range(100):
        try:
            found.append(check(kind, seed))
        except SheetOfLightError as reason:
            refused.append(f"{seed}: {reason}")
    errors = np.array(found)
    assert len(refused) <= 5, refused
    assert np.abs(errors).max() < 4.9
    assert np.mean(errors**2) < 1.0 + 4.0 * np.sqrt(2.0 / 100.0)


def test_a_wrong_marker_is_named() -> None:
    rig = paper_rig()
    seen = recorded(rig, RECORDING, np.random.default_rng(3))
    uv = seen.plane.uv.copy()
    along = uv[4, 2] - uv[4, 0]
    uv[4, 1] += 20.0 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
    spoiled = replace(seen, plane=TargetViews(seen.plane.names, uv))
    found = calibrate(Rig(rig.target, rig.camera.image_size, observations=spoiled))
    (warning,) = found.warnings
    assert "plane04" in warning
    assert "stage plane" in warning
    assert "1" in warning.split("marker", 1)[1].split("of view")[0]


def test_what_is_left_is_what_the_right_views_alone_give() -> None:
    """Leaving out is deciding, not weighing down: with the wrong view gone, nothing of it stays."""
    rig = paper_rig()
    seen = recorded(rig, RECORDING, np.random.default_rng(4))
    uv = seen.camera.uv.copy()
    uv[7] += np.array([[30.0, 0.0], [0.0, -40.0], [-25.0, 10.0]])
    size = rig.camera.image_size
    spoiled = replace(seen, camera=TargetViews(seen.camera.names, uv))
    without = replace(seen, camera=seen.camera.take(np.arange(30) != 7))
    one, two = (
        calibrate(Rig(rig.target, size, observations=views)) for views in (spoiled, without)
    )
    assert np.allclose(one.camera.parameters, two.camera.parameters, rtol=1e-7, atol=1e-6)
    assert one.covariance.matrix == pytest.approx(two.covariance.matrix, rel=1e-4, abs=1e-12)
    (warning,) = one.warnings
    assert "camera07" in warning
