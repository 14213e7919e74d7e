"""The edge model against brute force, and its derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest

from sheetoflight.imaging.stripe.edge import Window, fitted_edge, light_at
from tests.imaging.stripe.drawn_lines import Strip, drawn

PARAMETERS = [
    [100.0, 0.5, 1.3, 0.2, 0.4, 0.8, 3.0, 0.1, 20.0],
    [100.0, -0.5, 2.5, -0.3, -1.4, 0.6, 3.0, 0.0, 0.0],
    [100.0, 0.5, 0.6, 0.2, 0.4, 0.8, 3.0, 0.1, 20.0],
]


def window_of(picture, first, along, reach=12.0):
    v, u = np.indices(picture.shape)
    offset = np.stack([u - first[0], v - first[1]], axis=-1)
    s, t = -(offset @ along), offset @ np.array([along[1], -along[0]])
    use = (np.abs(s) < reach) & (np.abs(t) < 7.0)
    return Window(s[use], t[use], picture[use], np.zeros(int(use.sum()), dtype=bool))


@pytest.mark.parametrize("parameters", PARAMETERS, ids=["square", "oblique", "narrow"])
def test_derivatives_are_those_of_the_model(parameters):
    rng = np.random.default_rng(1)
    s, t = rng.uniform(-10.0, 8.0, 60), rng.uniform(-4.0, 4.0, 60)
    at = np.array(parameters)
    _, derivatives = light_at(at, s, t)
    for index, step in enumerate(1e-6 * np.eye(9)):
        difference = (light_at(at + step, s, t)[0] - light_at(at - step, s, t)[0]) / 2e-6
        assert np.allclose(derivatives[:, index], difference, atol=1e-5)


@pytest.mark.parametrize("shear", [0.0, 0.8, -1.5])
@pytest.mark.parametrize("blur", [0.5, 1.0])
def test_the_closed_form_is_what_brute_force_draws(shear, blur):
    """The pixel's box, taken as a blur of √(1/12) px, is the only approximation: its fourth
    cumulant leaves up to 0.7 % of the amplitude at blur 0.5 px."""
    strip = Strip((30.0, 20.0), (40.0, 60.0), sheet=1.2, blur=blur, shear=(shear, 0.0))
    window = window_of(drawn((80, 80), strip), strip.first, strip.along)
    p = np.hypot(blur, np.sqrt(1.0 / 12.0))
    w = np.hypot(strip.sheet, p)
    height = strip.amplitude * strip.sheet / w
    model, _ = light_at(
        np.array([height, 0.0, w, 0.0, shear, p, 0.0, 0.0, 0.0]), window.s, window.t
    )
    assert np.abs(model - window.samples).max() < 0.012 * strip.amplitude


@pytest.mark.parametrize("ambient", [0.0, 60.0])
def test_the_edge_is_where_it_was_drawn(ambient):
    strip = Strip((30.3, 20.6), (45.0, 70.0), shear=(0.6, 0.0), ambient=ambient)
    edge = fitted_edge(window_of(drawn((90, 90), strip), strip.first, strip.along), 1.2, 0.3)
    assert edge is not None
    assert abs(edge.s) < 0.005
    assert edge.shear == pytest.approx(0.6, abs=0.05)


def test_no_edge_is_found_in_the_middle_of_a_line():
    strip = Strip((10.0, 10.0), (70.0, 80.0))
    middle = strip.ends.mean(axis=0)
    rng = np.random.default_rng(2)
    picture = drawn((90, 90), strip) + rng.normal(0.0, 2.0, (90, 90))
    assert fitted_edge(window_of(picture, middle, strip.along), 1.2, 0.3) is None
