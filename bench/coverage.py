"""Whether the intervals hold, and whether the error is as small as it can be.

Rigs are simulated and calibrated; random lengths in the sheet are measured and compared with the
truth. For each case, over all calibrations:

- ``cover``: share of 95 % intervals that hold, of the calibration's part alone (image points free
  of noise) and with noisy image points,
- ``chi² p``: odds of the normalised errors' sum of squares, one length a calibration, Student's
  quantiles turned into normal ones,
- ``rms/bound``: root mean square error over the Cramér–Rao bound, which is the covariance for the
  true sizes of the noise, with its own standard error,
- ``refused``, ``left out``: calibrations that were refused – or of which the bound was, the true
  sizes of the noise being given – and those in which a right point was taken for wrong.

Run with ``python -m bench.coverage [CALIBRATIONS]``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import chi2, norm
from scipy.stats import t as student

import sheetoflight as sol
from sheetoflight.calibration.components import MARKER, PIXEL, PLACEMENT
from sheetoflight.calibration.joint_method import joint
from sheetoflight.calibration.noise import NoiseModel, noise_model
from sheetoflight.calibration.result import calibration_of
from sheetoflight.errors import SheetOfLightError
from sheetoflight.measurement.length import Length, lengths
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import Recording, recorded, segments_in_sheet
from sheetoflight.simulation.random_rigs import random_rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

SEED = 31
CALIBRATIONS = 2000
SHARES = (0.375, 1.0)
"""Lengths that are measured, as parts of the target's: 150 and 400 mm in the paper's rig."""


def seed_rig(
    _: np.random.Generator,
    markers: tuple[float, ...] = (0.0, 200.0, 400.0),
    distortion: tuple[float, ...] = (0.0,) * 5,
    lasers: int = 1,
) -> SimulatedRig:
    """The paper's rig, with another target, lens or number of lasers.

    The second sheet is not the first one mirrored: two such leave the camera open.
    """
    k1, k2, p1, p2, k3 = distortion
    rig = paper_rig((k1, k2, p1, p2, k3), CollinearTarget(markers))
    first = rig.light_plane
    other = LightPlane(first.normal * [-0.7, 6.0, 1.2], first.distance_mm, "right")
    return replace(rig, light_planes=(first, other)[:lasers])


@dataclass(frozen=True)
class Case:
    """A kind of rig and how it is recorded."""

    name: str
    recording: Recording
    rig: Callable[[np.random.Generator], SimulatedRig] = seed_rig
    distortion: str = "none"
    stated: bool = False
    method: str = "joint"
    hidden: bool = False
    """Whether the targets are off the sheet by less than so few views can show: the intervals are
    then known to be too narrow."""


UNEVEN = (0.0, 120.0, 300.0)
LENS = (-0.1, 0.05, 0.0, 0.0, 0.0)
CASES = (
    Case("camera + plane, 0.05 px", Recording(30, 10, pixel_std=0.05)),
    Case("camera + plane, 0.5 px", Recording(30, 10, pixel_std=0.5)),
    Case("… noise stated, 0.1 px", Recording(30, 10, pixel_std=0.1), stated=True),
    Case(
        "… l1 = 120, l2 = 180", Recording(30, 10, pixel_std=0.1), partial(seed_rig, markers=UNEVEN)
    ),
    Case(
        "… k1, k2", Recording(30, 10, pixel_std=0.1), partial(seed_rig, distortion=LENS), "radial2"
    ),
    Case("… few: 8 + 5", Recording(8, 5, pixel_std=0.1)),
    Case("… 0.3 mm off the sheet", Recording(30, 10, pixel_std=0.1, placement_mm=0.3)),
    Case(
        "… 0.08 mm off the sheet",
        Recording(30, 10, pixel_std=0.1, placement_mm=0.08),
        hidden=True,
    ),
    Case(
        "… 0.3 mm off, k1, k2",
        Recording(30, 10, pixel_std=0.1, placement_mm=0.3),
        partial(seed_rig, distortion=LENS, markers=UNEVEN),
        "radial2",
    ),
    Case(
        "… markers 0.3 mm off",
        Recording(30, 10, pixel_std=0.1, placement_mm=0.3, placement="markers"),
    ),
    Case("camera + crossing", Recording(30, 0, 10, pixel_std=0.1)),
    Case(
        "… k1, k2, uneven",
        Recording(30, 0, 12, pixel_std=0.2),
        partial(seed_rig, distortion=LENS, markers=UNEVEN),
        "radial2",
    ),
    Case("camera + plane + crossing", Recording(30, 10, 10, pixel_std=0.1)),
    Case("… 0.3 mm off", Recording(30, 10, 10, pixel_std=0.1, placement_mm=0.3)),
    Case(
        "… few: 20 + 6 + 8",
        Recording(20, 6, 8, pixel_std=0.2, placement_mm=0.3),
        hidden=True,
    ),
    Case("two lasers, plane alone", Recording(0, 12, pixel_std=0.1), partial(seed_rig, lasers=2)),
    Case("two-step", Recording(30, 10, pixel_std=0.1), method="two-step"),
    Case("random rigs", Recording(30, 10, pixel_std=0.1), random_rig),
    Case("random rigs, 0.3 px, mixed", Recording(20, 8, 4, pixel_std=0.3), random_rig),
)


@dataclass(frozen=True)
class Trial:
    """One calibration's lengths: errors, stated and bounding uncertainties, mm."""

    refused: str = ""
    left_out: int = 0
    errors: tuple[float, ...] = ()
    bounds: tuple[float, ...] = ()
    found: tuple[Length, ...] = ()
    noisy_hits: tuple[bool, ...] = ()


@dataclass(frozen=True)
class Result:
    """What a case came to."""

    case: Case
    calibrations: int
    refused: int
    left_out: int
    cover: float
    cover_noisy: float
    chi2_odds: float
    rms_over_bound: float
    rms_std: float
    reasons: tuple[str, ...] = field(default_factory=tuple)


def trial(case: Case, seed: int, number: int) -> Trial:
    """Simulate, calibrate, measure."""
    rng = np.random.default_rng([seed, number])
    truth = case.rig(rng)
    lasers = tuple(plane.name for plane in truth.light_planes)
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        distortion=case.distortion,
        pixel_std=case.recording.pixel_std if case.stated else None,
        lasers=lasers,
        observations=recorded(truth, case.recording, rng),
    )
    try:
        calibration = sol.calibrate(rig, case.method)
        bounding = _bounding(case, rig)
    except SheetOfLightError as refusal:
        return Trial(refused=str(refusal))
    true = np.array(SHARES) * truth.target.length_mm
    ends = np.concatenate([segments_in_sheet(truth, length, 1, rng) for length in true])
    uv = truth.camera.project(ends)
    noisy = uv + rng.normal(scale=case.recording.pixel_std, size=uv.shape)
    found = lengths(calibration, uv, np.full(len(uv), 1e-9), laser=lasers[0])
    bound = lengths(bounding, uv, np.full(len(uv), 1e-9), laser=lasers[0])
    with_noise = _measured_in_picture(calibration, noisy, lasers[0])
    hits = tuple(
        low <= length <= high
        for (low, high), length in zip((m.interval for m in with_noise), true, strict=False)
    )
    return Trial(
        left_out=sum("left out" in warning for warning in calibration.warnings),
        errors=tuple(m.value - length for m, length in zip(found, true, strict=True)),
        bounds=tuple(m.std for m in bound),
        found=tuple(found),
        noisy_hits=hits,
    )


def _measured_in_picture(calibration: Calibration, uv: np.ndarray, laser: str) -> list[Length]:
    size = np.array(calibration.camera.image_size) - 1.0
    return lengths(calibration, np.clip(uv, 0.0, size), laser=laser)


def _bounding(case: Case, rig: Rig) -> Calibration:
    """The calibration with the true sizes of the noise: its covariance is the bound."""
    recording = case.recording
    rod, single = (
        (recording.placement_mm, 0.0)
        if recording.placement == "rod"
        else (0.0, recording.placement_mm)
    )
    known = noise_model(rig)
    variances = known.variances.copy()
    variances[[PIXEL, PLACEMENT, MARKER]] = recording.pixel_std**2, rod**2, single**2
    true = NoiseModel(known.proportions, variances, np.zeros_like(known.free))
    return calibration_of("joint", rig, joint(rig, true), 1.0, ())


def run(case: Case, calibrations: int, pool: ProcessPoolExecutor, seed: int = SEED) -> Result:
    """All trials of a case."""
    done = list(pool.map(partial(trial, case, seed), range(calibrations), chunksize=20))
    good = [t for t in done if not t.refused]
    reasons = tuple(sorted({t.refused for t in done if t.refused}))[:3]
    if not good:
        nan = float("nan")
        return Result(case, calibrations, len(done), 0, nan, nan, nan, nan, nan, reasons)
    errors, bounds = np.array([t.errors for t in good]), np.array([t.bounds for t in good])
    hits = np.array([[low <= m.value - e <= high for m, e in zip(t.found, t.errors, strict=True)
                      for low, high in [m.interval]] for t in good])  # fmt: skip
    normal = np.array([_as_normal(t) for t in good])
    squares = errors**2 / np.mean(bounds**2, axis=0)
    means = squares.mean(axis=1)
    ratio = float(np.sqrt(means.mean()))
    return Result(
        case,
        calibrations,
        len(done) - len(good),
        sum(t.left_out > 0 for t in good),
        float(hits.mean()),
        float(np.mean([hit for t in good for hit in t.noisy_hits])),
        float(2 * min(p := chi2.sf(np.sum(normal**2), len(normal)), 1 - p)),
        ratio,
        float(means.std() / np.sqrt(len(means)) / (2 * ratio)),
        reasons,
    )


def _as_normal(t: Trial) -> float:
    """The first length's error over its uncertainty, as the normal quantile of like odds."""
    z = t.errors[0] / t.found[0].std
    freedom = t.found[0].degrees_of_freedom
    return z if np.isinf(freedom) else float(norm.isf(student.sf(z, freedom)))


def main(calibrations: int = CALIBRATIONS, only: str = "") -> None:
    """Print the table."""
    table = Table(title=f"{calibrations} calibrations each")
    table.add_column("case")
    headings = ("cover", "… with noisy ends", "chi² p", "rms/bound", "refused", "left out")
    for heading in headings:
        table.add_column(heading, justify="right")
    console = Console(width=120)
    with ProcessPoolExecutor(2) as pool:
        for case in CASES:
            if only not in case.name:
                continue
            r = run(case, calibrations, pool)
            row = (
                case.name,
                f"{r.cover:.1%}",
                f"{r.cover_noisy:.1%}",
                f"{r.chi2_odds:.3f}",
                f"{r.rms_over_bound:.3f} ± {r.rms_std:.3f}",
                str(r.refused),
                str(r.left_out),
            )
            table.add_row(*row)
            print(*row, sep=" | ", file=sys.stderr, flush=True)
            for reason in r.reasons:
                print(f"{case.name}: {reason[:200]}", file=sys.stderr)
    console.print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else CALIBRATIONS, *sys.argv[2:3])
