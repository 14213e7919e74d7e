"""Photographs of chessboards, laser lines and things: no target is in them, none may be found."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from sheetoflight.imaging.markers import find_target
from sheetoflight.model.target import CollinearTarget

PHOTOGRAPHS = Path(__file__).parents[3] / "shared" / "real"
ENDINGS = {".png", ".jpg", ".jpeg", ".bmp", ".tif"}
SAMPLED = 20


def sample() -> list[Path]:
    """Photographs at even distances through all folders."""
    every = sorted(p for p in PHOTOGRAPHS.rglob("*") if p.suffix.lower() in ENDINGS)
    return every[:: max(1, len(every) // SAMPLED)][:SAMPLED]


@pytest.mark.skipif(
    not PHOTOGRAPHS.is_dir(), reason="the photographs in ../shared/real are not here"
)
@pytest.mark.parametrize("kind", ["quadrant", "disc"])
def test_no_target_is_invented(kind) -> None:
    photographs = sample()
    assert photographs, f"{PHOTOGRAPHS} holds no photograph"
    for path in photographs:
        image = cv2.imread(str(path))
        assert image is not None, f"{path} is no picture"
        search = find_target(image, CollinearTarget(marker=kind))
        assert search.sighting is None, f"{path}: {search.reason}"
