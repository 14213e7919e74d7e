"""Laser lines that other people photographed: found where they are, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from sheetoflight.imaging.stripe.pieces import line_pieces

PHOTOGRAPHS = Path(__file__).resolve().parents[3] / "shared" / "real"
SATURATED = sorted((PHOTOGRAPHS / "etna_robot" / "set0").glob("frame*.png"))

pytestmark = pytest.mark.skipif(
    not PHOTOGRAPHS.is_dir(),
    reason=f"the photographs are not here: no folder {Path('..') / 'shared' / 'real'}",
)


def photograph(*parts: str) -> np.ndarray:
    picture = cv2.imread(str(PHOTOGRAPHS.joinpath(*parts)))
    assert picture is not None
    return picture


def all_centres(pieces):
    return np.concatenate([piece.uv for piece in pieces])


def test_the_red_line_on_a_bust_is_found_and_little_else():
    """The difference of the red channels, smoothed, is the judge: almost every centre lies where
    it is bright, and most of the rows in which it is bright have a centre."""
    on = photograph("ciclop_3dscanscience", "laser_object", "laser.png")
    off = photograph("ciclop_3dscanscience", "laser_object", "laser_background.png")
    uv = all_centres(line_pieces(on, off))
    red = cv2.GaussianBlur(on[..., 2].astype(float) - off[..., 2], (0, 0), 2.0)
    columns, rows = np.rint(uv).astype(int).T
    assert np.mean(red[rows, columns] > 20.0) > 0.98
    lit_rows = np.flatnonzero((red > 60.0).any(axis=1))
    assert np.isin(lit_rows, rows).mean() > 0.75


@pytest.mark.parametrize("path", SATURATED, ids=[path.stem for path in SATURATED])
def test_a_saturated_stripe_is_followed_along_its_middle(path: Path):
    """The middle of the full pixels of each row is the judge, within a tenth of the stripe's
    10 to 20 px of width, speckle and all."""
    picture = photograph("etna_robot", "set0", path.name)
    piece = max(line_pieces(picture), key=len)
    errors = []
    for u, v in piece.uv:
        full = np.flatnonzero(picture[round(float(v)), :, 0] >= 250)
        near = full[np.abs(full - u) < 15.0]
        if near.size >= 4:
            errors.append(u - near.mean())
    assert len(errors) > 200
    assert np.median(np.abs(errors)) < 1.0
    assert abs(np.median(errors)) < 0.5
