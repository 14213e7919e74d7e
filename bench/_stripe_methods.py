"""Ways to find a laser line, by name: ours, and those of `bench._stripe_peers`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from bench import _stripe_peers as peers
from bench._stripe_peers import Picture, Told
from sheetoflight.geometry.directions import Array
from sheetoflight.imaging.stripe.detectors import DETECTORS
from sheetoflight.imaging.stripe.extraction import StripeOptions, extract_stripe

_SCANNER = "sheetoflight.imaging.stripe.scan.scanner"


@dataclass(frozen=True)
class Method:
    """A way to find the line.

    Parameters
    ----------
    find : callable
        Centres ``(N, 2)``, px, in a picture.
    modules : tuple of str
        What must be there for it, by its names in Python.
    package : str
        What to install for it, as pip takes it; empty where it is no package.
    most_frames : int, optional
        How many frames of a kind it is given, if it is slow.
    """

    find: Callable[[Picture, Told], Array]
    modules: tuple[str, ...] = ()
    package: str = ""
    most_frames: int | None = None


def _extracted(detector: str) -> Method:
    options = StripeOptions(detector=detector)

    def find(picture: Picture, told: Told) -> Array:
        del told
        stripe = extract_stripe(picture, options=options)
        return stripe.uv[stripe.good]

    return Method(find)


def _scanned(detector: str) -> Method:
    def find(picture: Picture, told: Told) -> Array:
        del told
        from sheetoflight.imaging.stripe.scan.scanner import ScanOptions, scan

        found = scan(picture, ScanOptions(detector=detector))  # type: ignore[arg-type]
        u = np.flatnonzero(found.good)
        return np.stack([u.astype(float), found.across[u]], axis=-1)

    return Method(find, (_SCANNER,))


def _skimage(find: Callable[[Picture, Told], Array]) -> Method:
    return Method(find, ("skimage",), "scikit-image")


OURS = {
    **{f"extract_stripe {name}": _extracted(name) for name in ("auto", *DETECTORS)},
    **{
        f"scan {name}": _scanned(name)
        for name in ("centroid", "fir", "parabola", "gaussian", "steger")
    },
}
DEFAULT, SCRIPT, TEXTBOOK = "extract_stripe auto", "OpenCV window centroid", "textbook Steger"
PEERS = {
    "OpenCV column arg-max": Method(peers.brightest),
    SCRIPT: Method(peers.window_centroid),
    "OpenCV window centroid less dark": Method(peers.window_centroid_less_dark),
    "OpenCV column centre of mass": Method(peers.column_centroid),
    TEXTBOOK: Method(peers.textbook_steger),
    "scikit-image Otsu, skeletonize": _skimage(peers.skeleton),
    "scikit-image meijering, arg-max": _skimage(peers.meijering_ridge),
    "scikit-image frangi, arg-max": _skimage(peers.frangi_ridge),
    "scikit-image sato, arg-max": _skimage(peers.sato_ridge),
    "scikit-image sato, parabola": _skimage(peers.sato_parabola),
    # Without what it asks for: opencv-python lies in the same folder as opencv-python-headless.
    "ridge-detector": Method(
        peers.ridge_detector,
        ("ridge_detector", "skimage", "imageio"),
        "--no-deps ridge-detector",
        most_frames=3,
    ),
}
METHODS = OURS | PEERS


def installed(names: Iterable[str]) -> tuple[list[str], list[str]]:
    """Which methods can run here, and a line for each thing that is missing."""
    there, lines = [], []
    for name in names:
        missing = [module for module in METHODS[name].modules if not _is_there(module)]
        if missing:
            lines.append(_left_out(METHODS[name], missing))
        else:
            there.append(name)
    return there, list(dict.fromkeys(lines))


def _left_out(method: Method, missing: list[str]) -> str:
    mend = f"pip install {method.package}" if method.package else "left out"
    return f"{', '.join(missing)} not found: {mend}"


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # of the package that would hold it
        return False
