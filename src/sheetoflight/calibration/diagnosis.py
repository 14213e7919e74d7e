"""Which fault the residuals point to.

Every fault is a way in which the points, or their images, would move: a hypothesis with a few
columns Z of derivatives. Without estimating it, Rao's score test tells how much chi-squared would
fall, ``gᵀ S⁻¹ g`` with ``g`` and ``S`` the gradient and the information of its parameters, all
others eliminated, and how large the fault is, ``−S⁻¹ g`` with covariance ``S⁻¹``. All hypotheses
stand in one table; the one that chance could least bring about is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.fitting import Fit, fitted
from sheetoflight.calibration.noise import MARKER, PIXEL, PLACEMENT
from sheetoflight.calibration.residual_tests import exact
from sheetoflight.calibration.rig_state import LOCAL_SIZE, RigState
from sheetoflight.estimation.block_least_squares import scaled_inverse
from sheetoflight.estimation.variance_components import (
    Contrasts,
    reduced_model,
    variance_components,
)
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.camera import Camera
from sheetoflight.model.diagnosis import Finding

_SIGNIFICANT = 1e-5
"""Odds of chance, all trials counted, below which a fault is told."""

_TOLERANCES = 1.5**0.5
"""Standard deviation of a middle marker's offset from between the ends, in tolerances of one."""

_NOISY = 1e-3
"""The same for scatter that differs between stages or directions, which spoils the weights."""

_ODD_TAIL = 0.025
"""Odds below which residuals look as if a diagnosis were worth while; one rig in twenty."""


@dataclass(frozen=True)
class _Hypothesis:
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


def findings(fit: Fit) -> tuple[Finding, ...]:
    """What the residuals of a fit point to, the most likely first; empty where to nothing.

    Parameters
    ----------
    fit : Fit
        Of all stages together.
    """
    plain = without_placement(fit)
    try:
        tested = _Tested.of(plain)
    except np.linalg.LinAlgError:
        return ()
    if sum(tested.freedom.values()) < 3:
        return ()
    best: dict[str, tuple[float, _Hypothesis]] = {}
    for hypothesis in _hypotheses(plain, tested):
        fall = tested.fall(hypothesis)
        if fall > best.get(hypothesis.cause, (0.0, hypothesis))[0]:
            best[hypothesis.cause] = (fall, hypothesis)
    found = [confirmed(fit, tested, hypothesis) for _, hypothesis in best.values()]
    told = sorted((f for f in found if f is not None), key=lambda finding: -finding.explained)
    return (*told, *_bent_anyhow(fit, plain, tested), *_noisy_stages(_line_scatter(fit)))


def without_placement(fit: Fit) -> Fit:
    """The fit with the targets taken to lie in their sheets: what hides behind placement noise
    shows again."""
    if not fit.noise.variances[PLACEMENT:].any():
        return fit
    variances, free = fit.noise.variances.copy(), fit.noise.free.copy()
    variances[PLACEMENT:], free[PLACEMENT:] = 0.0, False
    noise = replace(fit.noise, variances=variances, free=free)
    stages, parameters = fit.adjustment.stages, fit.adjustment.parameters
    return fitted(fit.rig, stages, parameters, fit.state, noise, "joint")


def confirmed(fit: Fit, tested: _Tested, hypothesis: _Hypothesis) -> Finding | None:
    """A hypothesis as a finding, if it holds with the noise estimated anew beside it.

    Placement noise would pass for a fault, and a fault for placement noise, were the noise's
    sizes taken from a fit without the other; so both are estimated together (Wald's test).
    """
    size = fit.adjustment.shared_size
    count = next(iter(hypothesis.columns.values())).shape[-1]
    groups = [
        group.widened(hypothesis.columns.get(stage, None), size, count)
        for stage, group in zip(tested.stages, tested.widest(fit), strict=True)
    ]
    try:
        # a stated size may be wrong just where a fault is sought
        free = fit.noise.free | (np.arange(len(fit.noise.free)) == PIXEL)
        start = np.where(free, np.maximum(tested.sizes, 1e-12), fit.noise.variances)
        sizes = variance_components(groups, size + count, start, free).sizes
        model = reduced_model(groups, size + count, sizes)
        covariance = scaled_inverse(model.information)[0]
    except np.linalg.LinAlgError:
        return None
    estimate = -covariance @ model.gradient
    amount, own = estimate[size:], covariance[size:, size:]
    spread = own + np.diag(np.full(count, hypothesis.tolerance**2))
    placed_off = bool(sizes[PLACEMENT:].any())
    rest = _freedom(tested, hypothesis, count, placed_off)
    if rest < 1:
        return None
    ratio = float(amount @ np.linalg.solve(spread, amount)) / count
    odds = hypothesis.trials * float(fdtrc(count, rest, ratio))
    if not odds <= _SIGNIFICANT:
        return None
    text = hypothesis.text.format(
        size=float(amount[0]),
        std=float(np.sqrt(spread[0, 0])),
        norm=float(np.linalg.norm(amount)),
    )
    alone = np.linalg.inv(model.information[:size, :size])
    pulled = model.information[:size, size:] @ amount
    return Finding(
        hypothesis.stage,
        hypothesis.cause,
        text,
        hypothesis.remedy,
        explained=tested.explained(groups, estimate),
        odds=min(odds, 1.0),
        shift=float(np.sqrt(max(pulled @ alone @ pulled, 0.0))),
    )


def _freedom(tested: _Tested, hypothesis: _Hypothesis, count: int, placed_off: bool) -> float:
    """Degrees of freedom of the scatter that the hypothesis is judged by."""
    if placed_off and tuple(hypothesis.columns) == ("plane",):
        # a target's ends lie off its sheet together: each view is one independent witness
        views = len(tested.groups[tested.stages.index("plane")].values)
        return float(views - count)
    return sum(tested.freedom[stage] for stage in hypothesis.columns) - count


@dataclass(frozen=True)
class _Tested:
    """The fit, ready for hypotheses."""

    stages: tuple[str, ...]
    groups: Sequence[Contrasts]
    inverses: Sequence[Array]
    covariance: Array
    chi2: dict[str, float]
    freedom: dict[str, float]
    adjustment: Adjustment
    state: RigState
    sizes: Array

    @classmethod
    def of(cls, fit: Fit) -> _Tested:
        groups, covariance = fit.contrasts, fit.covariance
        inverses = [np.linalg.inv(group.covariance(fit.noise.variances)) for group in groups]
        chi2, freedom = {}, {}
        for (stage, views), group, inverse in zip(
            fit.adjustment.stages.items(), groups, inverses, strict=True
        ):
            chi2[stage] = float(np.einsum("ni,nij,nj->", group.values, inverse, group.values))
            own = covariance[np.ix_(group.columns, group.columns)]
            pull = np.swapaxes(group.by_shared, 1, 2) @ inverse @ group.by_shared
            observed = 2 * int(views.seen.sum()) - LOCAL_SIZE[stage] * len(views)
            freedom[stage] = observed - float(np.sum(own * pull.sum(axis=0)))
        return cls(
            tuple(fit.adjustment.stages),
            groups,
            inverses,
            covariance,
            chi2,
            freedom,
            fit.adjustment,
            fit.state,
            np.maximum(fit.noise.variances, 0.0),
        )

    def fall(self, hypothesis: _Hypothesis) -> float:
        """How much chi-squared would fall if the hypothesis were estimated."""
        terms = [self._terms(stage, moves) for stage, moves in hypothesis.columns.items()]
        sums = (np.sum([part.sum(axis=0) for part in parts], axis=0, keepdims=True)
                for parts in zip(*terms, strict=True))  # fmt: skip
        return float(self._falls(*sums)[0])

    def first_after_change(self, stage: str, moves: Array, views: np.ndarray, few: int) -> int:
        """From which of the views on, in their order, moves of the points explain most.

        Parameters
        ----------
        stage : str
        moves : (N, 2M, q) array
            How the image points would move, px per unit.
        views : (V,) int array
            Those among which the change is sought, at least ``2 few``.
        few : int
            Least number of views on either side.

        Returns
        -------
        int
            Place in `views`.
        """
        after = (
            np.cumsum(part[views[::-1]], axis=0)[::-1][few : len(views) - few + 1]
            for part in self._terms(stage, moves)
        )
        return few + int(self._falls(*after).argmax())

    def _terms(self, stage: str, moves: Array) -> tuple[Array, Array, Array]:
        """Each view's gradient ``(N, q)`` by moves of its points, their information
        ``(N, q, q)``, and that on them and the shared parameters ``(N, q, P)``."""
        place = self.stages.index(stage)
        group, inverse = self.groups[place], self.inverses[place]
        moved = group.across @ moves
        pull = np.swapaxes(moved, 1, 2) @ inverse
        mixed = np.zeros((*pull.shape[:2], len(self.covariance)))
        mixed[..., group.columns] = pull @ group.by_shared
        return (pull @ group.values[..., None])[..., 0], pull @ moved, mixed

    def _falls(self, gradient: Array, own: Array, mixed: Array) -> Array:
        """``gᵀ S⁻¹ g`` of K hypotheses from the sums of their views' terms."""
        left = own - mixed @ self.covariance @ np.swapaxes(mixed, 1, 2)
        scale = 1.0 / np.sqrt(np.maximum(np.einsum("kqq->kq", own), 1e-300))
        scaled = left * scale[:, :, None] * scale[:, None, :]
        inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True)
        return np.einsum("kp,kpq,kq->k", gradient * scale, inverse, gradient * scale)

    def widest(self, fit: Fit) -> list[Contrasts]:
        """The same contrasts with all noise components that are estimated."""
        return fit.noise.contrasts(self.adjustment, self.state, {})

    def explained(self, groups: Sequence[Contrasts], estimate: Array) -> float:
        """Share of the residuals' squares that estimated parameters take away."""
        before = sum(self.chi2.values())
        after = 0.0
        for group, inverse in zip(groups, self.inverses, strict=True):
            values = group.values + group.by_shared @ estimate[group.columns]
            after += float(np.einsum("ni,nij,nj->", values, inverse, values))
        return min(max(1.0 - after / before, 0.0), 1.0)


def _hypotheses(fit: Fit, tested: _Tested) -> Iterator[_Hypothesis]:
    yield from _lens(fit)
    yield from _marker_distances(fit)
    yield from _bent_targets(fit)
    yield from _slipped_pivots(fit, tested)
    yield from _moved_lasers(fit, tested)


def _images(fit: Fit, stage: str, moves: Sequence[Array]) -> Array:
    """Image motion ``(N, 2M, q)`` of moves ``(N, M, 3)`` of the points."""
    block = fit.adjustment.block(fit.state, stage, moves)
    return block.by_shared[..., -len(moves) :]


def _lens(fit: Fit) -> Iterator[_Hypothesis]:
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
        yield _Hypothesis(
            "camera",
            "unmodelled distortion",
            columns,
            f"the lens has a {what} that is not in the model",
            f'set distortion = "{model}" under [camera] in rig.toml',
        )


def _marker_distances(fit: Fit) -> Iterator[_Hypothesis]:
    """An inner marker that is not where rig.toml says; the ends give the scale."""
    for marker in range(1, len(fit.adjustment.positions) - 1):
        columns = {}
        for stage in fit.adjustment.stages:
            place = fit.adjustment.placed(fit.state, stage)
            move = np.zeros_like(place.points)
            move[:, marker] = place.along
            columns[stage] = _images(fit, stage, [move])
        yield _Hypothesis(
            "target",
            "wrong marker distance",
            columns,
            f"marker {marker} lies {{size:+.3g}} ± {{std:.1g}} mm from where markers_mm has it",
            "measure the distances of the markers again",
            tolerance=_TOLERANCES * fit.rig.target.tolerance_mm,
        )


def _bent_targets(fit: Fit) -> Iterator[_Hypothesis]:
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
        yield _Hypothesis(
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


def _slipped_pivots(fit: Fit, tested: _Tested) -> Iterator[_Hypothesis]:
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
    yield _Hypothesis(
        "camera",
        "slipped pivot",
        {"camera": np.where((every >= first)[:, None, None], whole, 0.0)},
        f"the fixed point moved by {{norm:.3g}} mm between views {views.names[first - 1]} and "
        f"{views.names[first]}",
        "clamp marker 0 and take the views again, or keep those of one side",
        trials=len(views) - 3,
    )


def _moved_lasers(fit: Fit, tested: _Tested) -> Iterator[_Hypothesis]:
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
        yield _Hypothesis(
            "plane",
            "moved laser",
            {"plane": np.where(late, whole, 0.0)},
            f"the sheet of {name} moved between views {views.names[mine[first - 1]]} and "
            f"{views.names[mine[first]]}",
            "fasten the laser and take the in-plane views again, or keep those of one side",
            trials=len(mine) - 5,
        )


def _bent_anyhow(fit: Fit, plain: Fit, tested: _Tested) -> list[Finding]:
    """Markers that scatter about the target's line more than along it, as those of a bent target
    that is held with another side towards the camera each time."""
    # single markers off their sheet are a noise of their own
    stages = [s for s in tested.stages if s != "plane" or not fit.noise.free[MARKER]]
    squares, count = _together(_line_scatter(plain, stages))
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


def _noisy_stages(scatter: Mapping[str, tuple[float, int]]) -> list[Finding]:
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


def suspicious(fit: Fit) -> bool:
    """Whether a diagnosis is worth its time: the residuals differ from the markers' scatter about
    their lines, which needs no calibration, or targets seem to lie off their sheet."""
    if exact(fit):
        return False
    if fit.noise.free[PLACEMENT] and fit.noise.variances[PLACEMENT:].any():
        return True
    scatter = _line_scatter(fit)
    if _noisy_stages(scatter):
        return True
    squares, count = _together(scatter)
    rest = fit.degrees_of_freedom - count
    if count < 3 or rest < 3:
        return True
    scale = fit.noise.variances[PIXEL] if fit.noise.free[PIXEL] else None
    chi2 = fit.degrees_of_freedom if scale is not None else fit.chi2
    ratio = ((chi2 - squares) / rest) / (squares / count) if squares > 0 else np.inf
    return not _ODD_TAIL < float(fdtrc(rest, count, max(ratio, 0.0))) < 1.0 - _ODD_TAIL


def _line_scatter(fit: Fit, stages: Sequence[str] | None = None) -> dict[str, tuple[float, int]]:
    """For each stage, sum of squares, in units of the pixel noise, and degrees of freedom of the
    markers' scatter about the image of a straight target with free pose: what no sheet and no
    pivot can cause."""
    return {stage: _scatter_of(fit, stage) for stage in stages or fit.adjustment.stages}


def _together(scatter: Mapping[str, tuple[float, int]]) -> tuple[float, int]:
    """Squares and degrees of freedom of all stages."""
    squares, counts = zip(*scatter.values(), strict=True) if scatter else ((), ())
    return sum(squares), sum(counts)


def _scatter_of(fit: Fit, stage: str) -> tuple[float, int]:
    views = fit.adjustment.stages[stage]
    markers = len(fit.adjustment.positions)
    place = fit.adjustment.placed(fit.state, stage)
    first, second = _free_turns(place.points[:, :markers], place.along)
    moves = [np.broadcast_to(axis, place.points.shape) for axis in np.eye(3)]
    moves += [first, second]
    padded = [_padded(move, place.points.shape[1]) for move in moves]
    block = fit.adjustment.block(fit.state, stage, padded)
    by_pose = block.by_shared[:, : 2 * markers, -len(moves) :]
    residuals = block.residuals[:, : 2 * markers]
    std = np.repeat(fit.noise.std(stage)[:, :markers], 2, axis=1)
    whole = views.seen[:, :markers].all(axis=1)
    if not whole.any():
        return 0.0, 0
    scaled = by_pose[whole] / std[whole][..., None]
    basis = np.linalg.qr(scaled, mode="complete")[0][..., 5:]
    rest = np.einsum("nri,nr->ni", basis, residuals[whole] / std[whole])
    return float(np.sum(rest**2)), int(rest.size)


def _free_turns(points: Array, along: Array) -> tuple[Array, Array]:
    """Motions ``(N, M, 3)`` of the markers when the target turns about its middle."""
    side = normalised(np.cross(along, points.mean(axis=1)))
    up = np.cross(along, side)
    offsets = np.sum((points - points.mean(axis=1, keepdims=True)) * along[:, None], axis=-1)
    return offsets[..., None] * side[:, None], offsets[..., None] * up[:, None]


def _padded(move: Array, points: int) -> Array:
    """A move of the markers, the spots staying where they are."""
    missing = points - move.shape[1]
    return np.concatenate([move, np.zeros((len(move), missing, 3))], axis=1) if missing else move
