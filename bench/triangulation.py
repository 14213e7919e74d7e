"""What points with uncertainty cost beside OpenCV's undistortion alone, on the same pixels.

A million centres of a laser line, a lens with five coefficients, and a covariance of camera and
sheet; OpenCV only takes the distortion away, with its default number of iterations. Run with
``python -m bench.triangulation [PIXELS]``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import cv2
import numpy as np

from sheetoflight.calibration.methods import calibrate
from sheetoflight.measurement.reconstruction import reconstruct
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.rig import Rig
from sheetoflight.model.stripe import Stripe
from sheetoflight.simulation.poses import observed_rig
from sheetoflight.simulation.rig import paper_rig

BROWN = (-0.1, 0.05, 0.0008, -0.0005, 0.01)
LIMIT = 3.0


def calibrated_rig() -> Calibration:
    """The paper's rig with a distorting lens, calibrated by simulated views."""
    truth = paper_rig(BROWN)
    observations = observed_rig(truth, 30, 10, 0.1, np.random.default_rng(0))
    rig = Rig(truth.target, truth.camera.image_size, distortion="brown", observations=observations)
    return calibrate(rig)


def stripe_of(count: int, image_size: tuple[int, int]) -> Stripe:
    """Centres all over the picture, in no order that would help."""
    rng = np.random.default_rng(1)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    return Stripe(
        uv=rng.uniform(0.0, np.array(image_size) - 1.0, (count, 2)),
        std=rng.uniform(0.02, 0.1, count),
        width=np.full(count, 2.0),
        peak=np.full(count, 100.0),
        across=np.stack([np.cos(angle), np.sin(angle)], axis=-1),
        line=np.zeros(count, dtype=np.int64),
        good=np.ones(count, dtype=bool),
        noise_std=1.0,
        detector="bench",
        reason="drawn",
    )


def seconds(task: Callable[[], object]) -> float:
    """Wall time of one run."""
    begin = time.perf_counter()
    task()
    return time.perf_counter() - begin


def times(calibration: Calibration, count: int, rounds: int) -> np.ndarray:
    """Seconds ``(rounds, 2)`` of ours and OpenCV's in turn, after one run of each to warm up."""
    stripe = stripe_of(count, calibration.image_size)
    pixels = stripe.uv[:, None].copy()
    matrix, distortion = calibration.camera.matrix, np.array(calibration.camera.distortion)
    tasks = (
        lambda: reconstruct(calibration, stripe),
        lambda: cv2.undistortPoints(pixels, matrix, distortion),
    )
    for task in tasks:
        task()
    return np.array([[seconds(task) for task in tasks] for _ in range(rounds)])


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    ours, opencv = times(calibrated_rig(), count, 15).T
    print(
        f"{count} pixels: points with uncertainty {1e3 * np.median(ours):.0f} ms, "
        f"cv2.undistortPoints {1e3 * np.median(opencv):.0f} ms, "
        f"{np.median(ours / opencv):.2f} times as long (limit {LIMIT:g})"
    )


if __name__ == "__main__":
    main()
