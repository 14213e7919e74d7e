"""The untidy wall."""

from __future__ import annotations

import numpy as np

from sheetoflight.simulation.clutter import clutter
from sheetoflight.simulation.paint import Block, Checker, Disc, Quadrants
from sheetoflight.simulation.render import RenderOptions, brightness
from sheetoflight.simulation.scene import Scene, wall_surface


def test_every_kind_of_thing_but_no_marker():
    paint = clutter(400.0, 300.0, 80, np.random.default_rng(3))
    assert {type(p) for p in paint} == {Block, Checker, Disc}
    assert not any(isinstance(p, Quadrants) for p in paint)


def test_same_generator_same_wall():
    one, again = (clutter(400.0, 300.0, 20, np.random.default_rng(3)) for _ in range(2))
    assert one == again


def test_things_are_seen_dark_and_bright(small_rig):
    paint = clutter(400.0, 300.0, 40, np.random.default_rng(3))
    wall = wall_surface(small_rig, 1500.0, paint)
    options = RenderOptions(ambient_gradient=(0.0, 0.0), vignetting=0.0)
    picture = brightness(small_rig, Scene((wall,)), options, laser=False)
    grey = options.ambient_level * wall.reflectance
    assert picture.min() < 0.5 * grey
    assert picture.max() > 2.0 * grey
    assert np.median(picture) == grey
