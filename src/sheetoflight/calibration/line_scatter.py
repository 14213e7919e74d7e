"""How the markers scatter about the lines of their targets, which needs no calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.fitting import Fit
from sheetoflight.calibration.noise import MARKER
from sheetoflight.calibration.score_tests import ScoredFit
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.diagnosis import Finding

_NOISY = 1e-3
"""Odds of chance below which scatter that differs between stages or directions is told; it spoils
the weights only."""


def line_scatter(fit: Fit, stages: Sequence[str] | None = None) -> dict[str, tuple[float, int]]:
    """For each stage, sum of squares, in units of the pixel noise, and degrees of freedom of the
    markers' scatter about the image of a straight target with free pose: what no sheet and no
    pivot can cause."""
    return {stage: _scatter_of(fit, stage) for stage in stages or fit.adjustment.stages}


def together(scatter: Mapping[str, tuple[float, int]]) -> tuple[float, int]:
    """Squares and degrees of freedom of all stages."""
    squares, counts = zip(*scatter.values(), strict=True) if scatter else ((), ())
    return sum(squares), sum(counts)


def _scatter_of(fit: Fit, stage: str) -> tuple[float, int]:
    views = fit.adjustment.stages[stage]
    markers = len(fit.adjustment.positions)
    whole = views.seen[:, :markers].all(axis=1)
    if not whole.any():
        return 0.0, 0
    place = fit.adjustment.placed(fit.state, stage)
    points = place.points[whole, :markers]
    uv, by_point, _ = fit.state.camera.project_with_jacobians(points, ())
    by_turn = by_point @ _free_turns(points, place.along[whole])
    by_pose = np.concatenate([by_point, by_turn], axis=-1).reshape(len(points), 2 * markers, 5)
    std = np.repeat(fit.noise.std(stage)[whole, :markers], 2, axis=1)
    basis = np.linalg.qr(by_pose / std[..., None], mode="complete")[0][..., 5:]
    residuals = (uv - views.uv[whole, :markers]).reshape(len(points), 2 * markers)
    rest = np.einsum("nri,nr->ni", basis, residuals / std)
    return float(np.sum(rest**2)), int(rest.size)


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
    squares, count = together(line_scatter(plain, stages))
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


def noisy_stages(scatter: Mapping[str, tuple[float, int]]) -> list[Finding]:
    """A stage whose markers scatter about their lines more than those of the others."""
    scatter = {stage: (s, n) for stage, (s, n) in scatter.items() if n >= 3}
    found = []
    for stage, (own, count) in scatter.items():
        others = [part for other, part in scatter.items() if other != stage]
        rest, rest_count = (sum(part) for part in zip(*others, strict=True)) if others else (0, 0)
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
