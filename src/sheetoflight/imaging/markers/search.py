"""The search for the target in one picture, step by step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sheetoflight.imaging.markers.candidate import Candidate
from sheetoflight.imaging.markers.discs import disc_candidates
from sheetoflight.imaging.markers.fit import MarkerFit, fitted_marker
from sheetoflight.imaging.markers.grey import GreyPicture, grey_picture
from sheetoflight.imaging.markers.identify import FINE, Match, largest_part, matches, spacing_error
from sheetoflight.imaging.markers.laser_line import laser_along
from sheetoflight.imaging.markers.line_light import bridged
from sheetoflight.imaging.markers.perspective import bias_left, disc_centres
from sheetoflight.imaging.markers.quadrants import quadrant_candidates
from sheetoflight.imaging.markers.sighting import TargetSearch, TargetSighting, listed
from sheetoflight.imaging.markers.strip import is_plain, strip_profiles
from sheetoflight.model.target import CollinearTarget, MarkerKind

_CANDIDATES: dict[MarkerKind, Callable[[GreyPicture], list[Candidate]]] = {
    "quadrant": quadrant_candidates,
    "disc": disc_candidates,
}
_MOST_MATCHES = 12
# One order of asymmetric discs is believed if its spacing fits so much better than the other's.
_CLEARLY_BETTER = 0.3


def find_target(image: np.ndarray, target: CollinearTarget) -> TargetSearch:
    """Find the markers of a collinear target, to a fraction of a pixel.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        uint8, uint16 or floating point; colour in OpenCV's order BGR.
    target : CollinearTarget

    Returns
    -------
    TargetSearch
        With the sighting, or None and the reason why there is none.

    Raises
    ------
    InputError
        If the image is no picture.
    """
    picture = grey_picture(image)
    find = _CANDIDATES[target.marker]
    candidates = find(picture)
    sightings = _sightings(picture, candidates, target)
    if not sightings:
        unlit = bridged(picture)
        if unlit is not None:
            beneath = find(GreyPicture(unlit, picture.noise))
            sightings = _sightings(picture, beneath, target)
            candidates = max(candidates, beneath, key=lambda c: len(largest_part(c, target)))
    return _outcome(sightings, candidates, target)


def _sightings(
    picture: GreyPicture, candidates: list[Candidate], target: CollinearTarget
) -> list[TargetSighting]:
    """Every whole target among the candidates, measured; no candidate serves two of them."""
    found: list[TargetSighting] = []
    taken: set[int] = set()
    for match in matches(candidates, target)[:_MOST_MATCHES]:
        if taken.isdisjoint(match.members):
            sighting = _measured(picture, match, target)
            if sighting is not None:
                found.append(sighting)
                taken.update(match.members)
    return found


def _measured(picture: GreyPicture, match: Match, target: CollinearTarget) -> TargetSighting | None:
    """The sighting that a match gives, or None where closer inspection refutes it."""
    markers = match.markers
    strip = strip_profiles(picture, markers)
    lines = laser_along(strip, np.array([m.centre for m in markers]), picture.noise)
    quadrant = target.marker == "quadrant"
    fits: list[MarkerFit] = []
    for marker, line in zip(markers, lines, strict=True):
        fit = fitted_marker(picture, marker, quadrant, line)
        if fit is None:
            return None
        fits.append(fit)
    shapes = [f.shape for f in fits]
    if not (matches(shapes, target, FINE) and is_plain(strip, shapes)):
        return None
    if quadrant:
        return _sighting(fits, np.array([f.uv for f in fits]), 0.0, ordered=True)
    # Of a normal lens, the focal length is about the picture's diagonal.
    return _sighting_of_discs(fits, target, float(np.hypot(*picture.values.shape)))


def _sighting_of_discs(
    fits: list[MarkerFit], target: CollinearTarget, focal_px: float
) -> TargetSighting:
    """Discs do not say which is marker 0: the spacing may, or the left end is taken for it."""
    positions = target.positions
    forward = spacing_error([f.shape for f in fits], positions)
    backward = spacing_error([f.shape for f in fits[::-1]], positions)
    symmetric = np.allclose(positions + positions[::-1], positions[-1], rtol=1e-9)
    ordered = not symmetric and (min(forward, backward) < _CLEARLY_BETTER * max(forward, backward))
    ends = fits[0].uv, fits[-1].uv
    if backward < forward if ordered else tuple(ends[1]) < tuple(ends[0]):
        fits = fits[::-1]
    uv = np.array([f.uv for f in fits])
    frames = np.array([f.shape.frame for f in fits])
    centres = disc_centres(uv, frames, positions)
    return _sighting(fits, centres, bias_left(frames, focal_px), ordered)


def _sighting(
    fits: list[MarkerFit], uv: np.ndarray, bias: np.ndarray | float, ordered: bool
) -> TargetSighting:
    noise = np.array([np.sqrt(np.trace(f.covariance) / 2) for f in fits])
    return TargetSighting(
        uv=uv,
        std=np.hypot(noise, bias),
        ordered=ordered,
        score=min(f.explained for f in fits),
        diameter=np.array([2 * f.shape.radius for f in fits]),
    )


def _outcome(
    sightings: list[TargetSighting], candidates: list[Candidate], target: CollinearTarget
) -> TargetSearch:
    if len(sightings) == 1:
        return TargetSearch(sightings[0], f"target found at {listed(sightings[0].uv)}")
    if sightings:
        places = listed(np.array([s.uv[0] for s in sightings]))
        return TargetSearch(
            None, f"{len(sightings)} targets found, beginning at {places}; expected one"
        )
    part = largest_part(candidates, target)
    count = len(target.markers_mm)
    if len(part) == count:
        places = listed(np.array([candidates[i].centre for i in part]))
        return TargetSearch(
            None,
            f"{count} markers found at {places}, but on closer inspection they are not the "
            "target: a marker is covered, or the strip between them is not plain",
        )
    if part:
        places = listed(np.array([candidates[i].centre for i in part]))
        return TargetSearch(None, f"{len(part)} of {count} markers found at {places}")
    if candidates:
        places = listed(np.array([c.centre for c in candidates[:count]]))
        return TargetSearch(
            None, f"no target found; patches like single markers do not fit together: {places}"
        )
    return TargetSearch(None, "no marker found")
