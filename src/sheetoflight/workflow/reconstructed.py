"""The laser line in space, from pictures and streams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.extraction import StripeOptions
from sheetoflight.io.frames import DamagedFrame, Frame
from sheetoflight.io.pictures import Picture
from sheetoflight.io.quoting import file_name
from sheetoflight.measurement.moving_object import line_moved_back, moved_back
from sheetoflight.measurement.reconstruction import reconstruct
from sheetoflight.measurement.straightness import SpaceLine, lines_of
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.point_cloud import PointCloud
from sheetoflight.model.stripe import Stripe
from sheetoflight.workflow.spread import ALONE, Execution
from sheetoflight.workflow.streamed import stream
from sheetoflight.workflow.stripes import WHAT, stripe_of


@dataclass(frozen=True)
class Reconstructed:
    """One picture's line, its points in space, and the straight lines through them."""

    stripe: Stripe
    cloud: PointCloud
    lines: tuple[SpaceLine, ...]


def find_points(
    calibration: AnyCalibration,
    frames: Sequence[Frame],
    options: StripeOptions | None = None,
    background: Picture | None = None,
    laser: str | None = None,
    run: Execution = ALONE,
    step_mm: Sequence[float] | None = None,
) -> Iterator[tuple[Frame, Reconstructed | DamagedFrame]]:
    """The laser line in every frame and its points in space, in order, at constant memory.

    Parameters
    ----------
    calibration : Calibration
    frames, options, background, run
        As for `find_stripes`.
    laser : str, optional
        In whose sheet the line lies; may be left out where there is one laser.
    step_mm : (3,) sequence of float, optional
        By what the object moves from one frame to the next, mm, camera frame (of a camera-free
        calibration, the sheet's own). The points of every frame are moved back by it as often as
        there are frames before, damaged ones counted: all come in the frame of the object at the
        first. (A stack that is cut short counts for its whole frames and one more.)

    Raises
    ------
    InputError
        If the laser is not known, or the step is no three finite numbers.
    """
    calibration.sheet(laser)
    step = None if step_mm is None else _checked_step(step_mm)
    work = partial(
        _points,
        calibration=calibration,
        options=options or StripeOptions(),
        background=background,
        laser=laser,
    )
    found = stream(work, frames, WHAT, run)
    return found if step is None else _moved_back(found, step)


def _checked_step(step_mm: Sequence[float]) -> Array:
    step = np.asarray(step_mm, dtype=float)
    if step.shape != (3,) or not np.isfinite(step).all():
        raise InputError(
            f"the object's step is {list(step_mm)}",
            "give three finite numbers, x, y and z in mm",
        )
    return step


def _moved_back(
    found: Iterator[tuple[Frame, Reconstructed | DamagedFrame]], step: Array
) -> Iterator[tuple[Frame, Reconstructed | DamagedFrame]]:
    for number, (frame, result) in enumerate(found):
        if isinstance(result, Reconstructed):
            cloud = moved_back(result.cloud, step, number)
            lines = tuple(line_moved_back(line, step, number) for line in result.lines)
            yield frame, replace(result, cloud=cloud, lines=lines)
        else:
            yield frame, result


def _points(
    frame: Frame,
    on: Picture,
    off: Picture | None,
    calibration: AnyCalibration,
    options: StripeOptions,
    background: Picture | None,
    laser: str | None,
) -> Reconstructed:
    height, width = on.shape[:2]
    if (width, height) != tuple(calibration.image_size):
        raise InputError(
            f"{file_name(frame.name)} has {width}×{height} pixels, the calibrated camera "
            f"{calibration.image_size[0]}×{calibration.image_size[1]}",
            "reconstruct pictures of the calibrated camera, uncropped",
        )
    stripe = stripe_of(frame, on, off, options, background)
    cloud = reconstruct(calibration, [(frame.name, stripe)], laser)
    return Reconstructed(stripe, cloud, tuple(lines_of(cloud, calibration, laser)))
