"""How the markers scatter about the lines of their targets, which needs no calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtrc

from sheetoflight.calibration.components import MARKER
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.score_tests import ScoredFit
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera
from sheetoflight.model.diagnosis import Finding

_LENS = (Camera.PARAMETERS.index("k1"),)

_NOISY = 1e-3
"""Odds of chance below which scatter that differs between stages or directions is told; it spoils
the weights only."""


@dataclass(frozen=True)
class Scatter:
    """How the markers of a stage scatter about the images of straight targets with free poses: what
    no sheet and no pivot can cause.

    Parameters
    ----------
    squares : float
        Their sum, in units of the pixel noise.
    freedom : int
        Its degrees of freedom.
    lens_pull, lens_strength : float
        Gradient of half the sum by a radial distortion k1, and information on it.
    typical : float
        Variance that the median of the squares shows: single wrong markers leave it as it is.
    """

    squares: float = 0.0
    freedom: int = 0
    lens_pull: float = 0.0
    lens_strength: float = 0.0
    typical: float = 0.0

    def __add__(self, other: Scatter) -> Scatter:
        whole = max(self.freedom + other.freedom, 1)
        return Scatter(
            self.squares + other.squares,
            self.freedom + other.freedom,
            self.lens_pull + other.lens_pull,
            self.lens_strength + other.lens_strength,
            (self.freedom * self.typical + other.freedom * other.typical) / whole,
        )

    @property
    def lens_odds(self) -> float:
        """Odds of chance that so much of the scatter goes with the lens's distortion."""
        if self.freedom < 2 or not self.lens_strength > 0:
            return 1.0
        explained = min(self.lens_pull**2 / self.lens_strength, self.squares)
        rest = max(self.squares - explained, 1e-300)
        return float(fdtrc(1, self.freedom - 1, explained / rest * (self.freedom - 1)))


def line_scatter(fit: Fit, stages: Sequence[str] | None = None) -> dict[str, Scatter]:
    """The markers' scatter, stage by stage."""
    return {stage: _scatter_of(fit, stage) for stage in stages or fit.adjustment.stages}


def together(scatter: Mapping[str, Scatter]) -> Scatter:
    """Of all stages."""
    return sum(scatter.values(), Scatter())


def _scatter_of(fit: Fit, stage: str) -> Scatter:
    views = fit.adjustment.stages[stage]
    markers = len(fit.adjustment.positions)
    whole = views.seen[:, :markers].all(axis=1)
    if not whole.any():
        return Scatter()
    place = fit.adjustment.placed(fit.state, stage)
    points = place.points[whole, :markers]
    uv, by_point, by_lens = fit.state.camera.project_with_jacobians(points, _LENS)
    by_turn = by_point @ _free_turns(points, place.along[whole])
    by_pose = np.concatenate([by_point, by_turn], axis=-1).reshape(len(points), 2 * markers, 5)
    std = np.repeat(fit.noise.std(stage)[whole, :markers], 2, axis=1)
    basis = np.linalg.qr(by_pose / std[..., None], mode="complete")[0][..., 5:]
    residuals = (uv - views.uv[whole, :markers]).reshape(len(points), 2 * markers)
    across = np.swapaxes(basis, 1, 2)
    rest = across @ (residuals / std)[..., None]
    lens = across @ (by_lens.reshape(residuals.shape) / std)[..., None]
    return Scatter(
        float(np.sum(rest**2)),
        rest.size,
        float(np.vdot(lens, rest)),
        float(np.sum(lens**2)),
        float(np.median(rest**2)) / float(chdtri(1, 0.5)),
    )


def _free_turns(points: Array, along: Array) -> Array:
    """Motions ``(N, M, 3, 2)`` of the markers when the target turns about its middle."""
    side = normalised(np.cross(along, points.mean(axis=1)))
    up = np.cross(along, side)
    offsets = np.sum((points - points.mean(axis=1, keepdims=True)) * along[:, None], axis=-1)
    return offsets[..., None, None] * np.stack([side, up], axis=-1)[:, None]


def bent_anyhow(fit: Fit, plain: Fit, tested: ScoredFit) -> list[Finding]:
    """Markers that scatter about the target's line more than along it, as those of a bent target
    that is held with another side towards the camera each time."""
    # single markers off their sheet are a noise of their own
    stages = [s for s in tested.stages if s != "plane" or not fit.noise.free[MARKER]]
    across = together(line_scatter(plain, stages))
    squares, count = across.squares, across.freedom
    rest = sum(tested.freedom[s] for s in stages) - count
    left = sum(tested.chi2[s] for s in stages) - squares
    if count < 3 or rest < 3 or not left > 0:
        return []
    ratio = (squares / count) / (left / rest)
    odds = float(fdtrc(count, rest, ratio))
    if odds > _NOISY:
        return []
    return [
        Finding(
            "target",
            "bent target",
            f"the markers scatter about the target's line {np.sqrt(ratio):.1f} times as much as "
            "along it",
            "use a stiff, straight target, and check that its markers lie on one line",
            explained=1.0 - left / rest * (rest + count) / (left + squares),
            odds=odds,
            shift=0.0,
        )
    ]


def noisy_stages(scatter: Mapping[str, Scatter]) -> list[Finding]:
    """A stage whose markers scatter about their lines more than those of the others."""
    scatter = {stage: part for stage, part in scatter.items() if part.freedom >= 3}
    found = []
    for stage, part in scatter.items():
        own, count = part.squares, part.freedom
        others = together({other: part for other, part in scatter.items() if other != stage})
        rest, rest_count = others.squares, others.freedom
        if not rest:
            continue
        ratio = (own / count) / (rest / rest_count)
        odds = len(scatter) * float(fdtrc(count, rest_count, ratio))
        if odds > _NOISY:
            continue
        whole = (own + rest) / (count + rest_count)
        found.append(
            Finding(
                stage,
                "noisy stage",
                f"the image points of this stage scatter {np.sqrt(ratio):.1f} times as much as "
                "those of the others",
                "look for defocus, motion blur or poor light in these pictures",
                explained=max(0.0, 1.0 - rest / rest_count / whole),
                odds=odds,
                shift=0.0,
            )
        )
    return found
