"""The laser line in space, from pictures and streams."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.extraction import StripeOptions
from sheetoflight.io.frames import DamagedFrame, Frame
from sheetoflight.io.pictures import Picture
from sheetoflight.measurement.reconstruction import reconstruct
from sheetoflight.model.calibration import AnyCalibration
from sheetoflight.model.point_cloud import PointCloud
from sheetoflight.model.stripe import Stripe
from sheetoflight.workflow.spread import ALONE, Execution
from sheetoflight.workflow.streamed import stream
from sheetoflight.workflow.stripes import WHAT, stripe_of


@dataclass(frozen=True)
class Reconstructed:
    """One picture's line and its points in space."""

    stripe: Stripe
    cloud: PointCloud


def find_points(
    calibration: AnyCalibration,
    frames: Sequence[Frame],
    options: StripeOptions | None = None,
    background: Picture | None = None,
    laser: str | None = None,
    run: Execution = ALONE,
) -> Iterator[tuple[Frame, Reconstructed | DamagedFrame]]:
    """The laser line in every frame and its points in space, in order.

    Parameters
    ----------
    calibration : Calibration
    frames, options, background, run
        As for `find_stripes`.
    laser : str, optional
        In whose sheet the line lies; may be left out where there is one laser.

    Raises
    ------
    InputError
        If the laser is not known.
    """
    calibration.sheet(laser)
    work = partial(
        _points,
        calibration=calibration,
        options=options or StripeOptions(),
        background=background,
        laser=laser,
    )
    yield from stream(work, frames, WHAT, run)


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
            f"{frame.name} has {width}×{height} pixels, the calibrated camera "
            f"{calibration.image_size[0]}×{calibration.image_size[1]}",
            "reconstruct pictures of the calibrated camera, uncropped",
        )
    stripe = stripe_of(frame, on, off, options, background)
    return Reconstructed(stripe, reconstruct(calibration, [(frame.name, stripe)], laser))
