"""The faults that a rig can have, as ways in which its points, or their images, would move."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.score_tests import ScoredFit
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera

_TOLERANCES = 1.5**0.5
"""Standard deviation of a middle marker's offset from between the ends, in tolerances of one."""


@dataclass(frozen=True)
class Hypothesis:
    """A fault with q parameters.

    Parameters
    ----------
    stage, cause : str
    columns : mapping from stage to (N, 2M, q) array
        How the image points would move, px per unit; stages that it leaves alone are missing.
    text : str
        With a place for the size.
    remedy : str
    trials : int
        How many alike hypotheses are tried, this being the best of them.
    tolerance : float
        Standard deviation that the first parameter has without any fault.
    """

    stage: str
    cause: str
    columns: dict[str, Array]
    text: str
    remedy: str
    trials: int = 1
    tolerance: float = 0.0


def hypotheses(fit: Fit, tested: ScoredFit) -> Iterator[Hypothesis]:
    """All faults that the stages of a fit can show.

    Parameters
    ----------
    fit : Fit
        Of all stages together.
    tested : ScoredFit
        The same, to find between which views a change is likeliest.
    """
    yield from _lens(fit)
    yield from _marker_distances(fit)
    yield from _bent_targets(fit)
    yield from _slipped_pivots(fit, tested)
    yield from _moved_lasers(fit, tested)
    yield from _other_cameras(fit)


def _images(fit: Fit, stage: str, moves: Sequence[Array]) -> Array:
    """Image motion ``(N, 2M, q)`` of moves ``(N, M, 3)`` of the points."""
    block = fit.adjustment.block(fit.state, stage, moves)
    return block.by_shared[..., -len(moves) :]


def _lens(fit: Fit) -> Iterator[Hypothesis]:
    """Coefficients of the lens that are not estimated."""
    free = fit.adjustment.parameters
    for names, what in (
        (("k1",), "radial distortion k1 of about {size:.3g} ± {std:.1g}"),
        (("k1", "k2"), "radial distortion k1, k2, with k1 about {size:.3g} ± {std:.1g}"),
        (("p1", "p2"), "tangential distortion, p1 about {size:.2g} ± {std:.1g}"),
    ):
        missing = [name for name in names if f"camera.{name}" not in free]
        if not missing:
            continue
        indices = [Camera.PARAMETERS.index(name) for name in missing]
        columns = {}
        for stage in fit.adjustment.stages:
            points = fit.adjustment.placed(fit.state, stage).points
            _, _, by_lens = fit.state.camera.project_with_jacobians(points, indices)
            seen = fit.adjustment.stages[stage].seen
            by_lens = np.where(seen[..., None, None], by_lens, 0.0)
            columns[stage] = by_lens.reshape(len(by_lens), -1, len(indices))
        model = "brown" if "p1" in missing else "radial2" if len(names) > 1 else "radial1"
        yield Hypothesis(
            "camera",
            "unmodelled distortion",
            columns,
            f"the lens has a {what} that is not in the model",
            f'set distortion = "{model}" under [camera] in rig.toml',
        )


def _marker_distances(fit: Fit) -> Iterator[Hypothesis]:
    """An inner marker that is not where rig.toml says; the ends give the scale."""
    for marker in range(1, len(fit.adjustment.positions) - 1):
        columns = {}
        for stage in fit.adjustment.stages:
            place = fit.adjustment.placed(fit.state, stage)
            move = np.zeros_like(place.points)
            move[:, marker] = place.along
            columns[stage] = _images(fit, stage, [move])
        yield Hypothesis(
            "target",
            "wrong marker distance",
            columns,
            f"marker {marker} lies {{size:+.3g}} ± {{std:.1g}} mm from where markers_mm has it",
            "measure the distances of the markers again",
            tolerance=_TOLERANCES * fit.rig.target.tolerance_mm,
        )


def _bent_targets(fit: Fit) -> Iterator[Hypothesis]:
    """A bow in the target: towards the camera, sideways to it, or sagging down."""
    positions = fit.adjustment.positions
    share = (positions - positions[0]) / (positions[-1] - positions[0])
    profile = 4.0 * share * (1.0 - share)
    for name, direction in (
        ("towards the camera", _towards_camera),
        ("sideways, seen from the camera", _sideways),
        ("downwards in the picture", _downwards),
    ):
        columns = {}
        for stage in fit.adjustment.stages:
            place = fit.adjustment.placed(fit.state, stage)
            move = np.zeros_like(place.points)
            bow = direction(place.points[:, : len(positions)], place.along)
            move[:, : len(positions)] = profile[:, None] * bow[:, None, :]
            columns[stage] = _images(fit, stage, [move])
        yield Hypothesis(
            "target",
            "bent target",
            columns,
            f"the target is bent {name} by {{size:+.3g}} ± {{std:.1g}} mm in its middle",
            "use a stiff, straight target, and support it",
            trials=3,
        )


def _towards_camera(points: Array, along: Array) -> Array:
    ray = -normalised(points.mean(axis=1))
    return normalised(ray - np.sum(ray * along, axis=1, keepdims=True) * along)


def _sideways(points: Array, along: Array) -> Array:
    return normalised(np.cross(along, normalised(points.mean(axis=1))))


def _downwards(_: Array, along: Array) -> Array:
    down = np.broadcast_to(np.array([0.0, 1.0, 0.0]), along.shape)
    return down - np.sum(down * along, axis=1, keepdims=True) * along


def _slipped_pivots(fit: Fit, tested: ScoredFit) -> Iterator[Hypothesis]:
    """The fixed point moved between two views, and stayed there."""
    views = fit.adjustment.stages.get("camera")
    if views is None or len(views) < 4:
        return
    place = fit.adjustment.placed(fit.state, "camera")
    axes = np.eye(3)
    moves = [np.broadcast_to(axis, place.points.shape) for axis in axes]
    whole = _images(fit, "camera", moves)
    every = np.arange(len(views))
    first = tested.first_after_change("camera", whole, every, few=2)
    yield Hypothesis(
        "camera",
        "slipped pivot",
        {"camera": np.where((every >= first)[:, None, None], whole, 0.0)},
        f"the fixed point moved by {{norm:.3g}} mm between views {views.names[first - 1]} and "
        f"{views.names[first]}",
        "clamp marker 0 and take the views again, or keep those of one side",
        trials=len(views) - 3,
    )


def _moved_lasers(fit: Fit, tested: ScoredFit) -> Iterator[Hypothesis]:
    """A sheet that moved between two views, and stayed there."""
    views = fit.adjustment.stages.get("plane")
    if views is None:
        return
    place = fit.adjustment.placed(fit.state, "plane")
    for laser, name in enumerate(fit.rig.lasers):
        mine = np.flatnonzero(views.lasers == laser)
        if len(mine) < 6:
            continue
        moves = [place.by_shared[..., 3 * laser + part] for part in range(3)]
        whole = _images(fit, "plane", moves)
        first = tested.first_after_change("plane", whole, mine, few=3)
        late = np.isin(np.arange(len(views)), mine[first:])[:, None, None]
        yield Hypothesis(
            "plane",
            "moved laser",
            {"plane": np.where(late, whole, 0.0)},
            f"the sheet of {name} moved between views {views.names[mine[first - 1]]} and "
            f"{views.names[mine[first]]}",
            "fasten the laser and take the in-plane views again, or keep those of one side",
            trials=len(mine) - 5,
        )


def _other_cameras(fit: Fit) -> Iterator[Hypothesis]:
    """Another camera in the sheet than about the fixed point.

    In-plane views alone give their sheet's homography to the image, three numbers for the sheet and
    two for the camera (Zhang 2000): with two of its parameters free in them, no more is asked of
    them than method camera-free asks. So this is the cross-check of that method with the rest.
    """
    if not {"camera", "plane"} <= fit.adjustment.stages.keys():
        return
    camera, seen = fit.state.camera, fit.adjustment.stages["plane"].seen
    points = fit.adjustment.placed(fit.state, "plane").points
    names = ("alpha", "beta", "u0", "v0")
    _, _, by_camera = camera.project_with_jacobians(
        points, [Camera.PARAMETERS.index(name) for name in names]
    )
    by_camera = np.where(seen[..., None, None], by_camera, 0.0)
    by_focus = by_camera[..., 0] * camera.alpha + by_camera[..., 1] * camera.beta
    for centre in (2, 3):
        columns = np.stack([by_focus, by_camera[..., centre]], axis=-1)
        yield Hypothesis(
            "plane",
            "stages disagree",
            {"plane": columns.reshape(len(columns), -1, 2)},
            "the in-plane views ask for another camera than the pivoting target does, its focal "
            "length {size:+.2%} off (± {std:.1%})",
            "leave focus, zoom and camera alone between the stages, and use one and the same "
            "target in both; else take the views again",
            trials=2,
        )
