"""Rig folders: which pictures, what they show, and that their truth is true."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import normalised
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.picture import ViewOptions
from sheetoflight.simulation.render import RenderOptions, render
from sheetoflight.simulation.views import (
    blank_scene,
    folder_truth,
    picture_tasks,
    render_task,
    rig_pictures,
)

SEGMENTS = (150.0, 90.0)


@pytest.fixture
def tasks(small_rig):
    return picture_tasks(small_rig, 12, 9, SEGMENTS, seed=5)


def test_names_and_stages(small_rig):
    pictures = list(rig_pictures(small_rig, 2, 1, SEGMENTS, seed=5))
    assert [(p.stage, p.name) for p in pictures] == [
        ("camera", "camera00"),
        ("camera", "camera01"),
        ("plane", "plane00_off"),
        ("plane", "plane00_on"),
        ("measure", "bar00_off"),
        ("measure", "bar00_on"),
        ("measure", "bar01_off"),
        ("measure", "bar01_on"),
    ]
    assert all(p.image.shape == (240, 320) and p.image.dtype == np.uint8 for p in pictures)


def test_truth_is_the_geometry_of_the_stage(small_rig, tasks):
    """Targets pivot about the anchor or lie in the sheet; bars lie in it; all are projected."""
    sheet = small_rig.light_plane
    for task in tasks:
        key = "ends" if task.stage == "measure" else "markers"
        xyz, uv = (np.array(task.truth[f"{key}_{end}"]) for end in ("xyz", "uv"))
        np.testing.assert_array_equal(uv, small_rig.camera.project(xyz))
        along = np.linalg.norm(xyz - xyz[0], axis=1)
        if task.stage == "measure":
            index = int(task.view.removeprefix("bar"))
            assert task.truth["length_mm"] == pytest.approx(SEGMENTS[index])
            assert along[1] == pytest.approx(SEGMENTS[index])
        else:
            np.testing.assert_allclose(along, small_rig.target.positions, atol=1e-9)
        if task.stage == "camera":
            np.testing.assert_allclose(xyz[0], small_rig.anchor_mm)
        else:
            np.testing.assert_allclose(xyz @ sheet.normal, sheet.distance_mm, atol=1e-9)


def test_whole_markers_are_in_the_picture(small_rig, tasks):
    """Every point of every marker's rim, in space, projects at least the margin inside."""
    size = np.array(small_rig.camera.image_size) - 1
    for task in (t for t in tasks if t.stage != "measure"):
        strip = task.scene.surfaces[0]
        turns = np.linspace(0.0, 2 * np.pi, 40)
        radius = small_rig.target.marker_size_mm / 2
        rim = radius * (
            np.cos(turns)[:, None] * strip.axes[0] + np.sin(turns)[:, None] * strip.axes[1]
        )
        uv = small_rig.camera.project(np.array(task.truth["markers_xyz"])[:, None, :] + rim)
        # a rim nearer to the camera than its centre reaches out by at most radius/Z more
        slack = ViewOptions().margin_px * 0.9
        assert (uv > slack).all()
        assert (uv < size - slack).all()


def test_nothing_is_held_edge_on(small_rig, tasks):
    """Neither to the camera nor, in stages with laser, to the projector."""
    limit = math.cos(math.radians(ViewOptions().max_tilt_deg))
    for task in tasks:
        surface = task.scene.surfaces[0]
        normal = np.cross(*surface.axes)
        ends = surface.centre + np.outer([-1, 1], surface.axes[0] * small_rig.target.length_mm / 2)
        points = ends if task.stage != "measure" else np.array(task.truth["ends_xyz"])
        sources = [np.zeros(3)] if task.stage == "camera" else [np.zeros(3), small_rig.projector_mm]
        cosines = np.array([normalised(source - points) @ normal for source in sources])
        cosines *= np.sign(cosines[0, 0])
        assert cosines.min() >= limit - 1e-12


def test_stages_do_not_depend_on_each_other(small_rig):
    """More views in one stage leave the others – and the earlier ones – as they were."""
    few = {t.name: t for t in picture_tasks(small_rig, 1, 2, SEGMENTS[:1], seed=5)}
    many = {t.name: t for t in picture_tasks(small_rig, 4, 3, SEGMENTS[:1], seed=5)}
    for name, task in few.items():
        assert many[name].truth == task.truth
        assert many[name].key == task.key


def test_any_order_gives_the_same_bytes(small_rig):
    """Rendered backwards, after a journey to another process, under the same seed."""
    serial = list(rig_pictures(small_rig, 1, 1, SEGMENTS[:1], seed=5))
    sent = pickle.loads(pickle.dumps(picture_tasks(small_rig, 1, 1, SEGMENTS[:1], seed=5)))
    backwards = [render_task(task) for task in reversed(sent)][::-1]
    for a, b in zip(serial, backwards, strict=True):
        assert a.name == b.name
        assert a.truth == b.truth
        np.testing.assert_array_equal(a.image, b.image)


def test_every_picture_has_noise_of_its_own(small_rig, tasks):
    assert len({task.key for task in tasks}) == len(tasks)
    other = picture_tasks(small_rig, 1, 0, seed=6)[0]
    assert other.truth != tasks[0].truth


def test_line_appears_between_the_ends_of_a_bar(small_rig):
    """On minus off: light along the axis between the true ends, none beyond them.

    With 10 electrons of read noise and under 3 000 of signal beside the line, a mean of 40
    pixels has a standard error under 0.0005 of full scale; 0.01 is twenty of them.
    """
    off, on = rig_pictures(small_rig, 0, 0, (200.0,), seed=2)
    difference = (on.image.astype(float) - off.image) / 255
    first, second = np.array(on.truth["ends_uv"])

    def along(low: float, high: float) -> float:
        points = first + np.linspace(low, high, 40)[:, None] * (second - first)
        u, v = np.rint(points).astype(int).T
        return float(difference[v, u].mean())

    assert along(0.1, 0.9) > 0.1
    assert abs(along(-0.12, -0.05)) < 0.01
    assert abs(along(1.05, 1.12)) < 0.01


def test_default_light_neither_clips_nor_drowns_the_line(small_rig):
    """On white, the line's peak adds more than an eighth of full scale, and none saturates."""
    options = ViewOptions(render=RenderOptions(noise=False))
    pictures = list(rig_pictures(small_rig, 0, 3, (150.0,), options, seed=1))
    for off, on in zip(pictures[::2], pictures[1::2], strict=True):
        added = on.image.astype(int) - off.image
        assert on.image.max() < 255
        assert added.max() > 255 / 8


def test_folder_truth_survives_json(small_rig, tasks):
    truth = json.loads(json.dumps(folder_truth(small_rig, tasks)))
    assert truth["camera"]["matrix"] == small_rig.camera.matrix.tolist()
    assert truth["light_plane"]["distance_mm"] == small_rig.light_plane.distance_mm
    assert {stage: len(views) for stage, views in truth["views"].items()} == {
        "camera": 12,
        "plane": 9,
        "measure": 2,
    }
    for task in tasks:
        assert truth["views"][task.stage][task.view] == task.truth


def test_blank_scene_shows_the_wall_alone(small_rig):
    options = ViewOptions(render=RenderOptions(noise=False))
    scene = blank_scene(small_rig, options)
    picture = render(small_rig, scene, options.render)
    assert picture.max() <= 180 * scene.surfaces[0].reflectance * 1.14
    assert len(scene.surfaces) == 1


def test_clutter_is_the_same_wall_in_every_picture(small_rig):
    tasks = picture_tasks(small_rig, 2, 1, options=ViewOptions(clutter=30), seed=5)
    walls = {task.scene.surfaces[1].paint for task in tasks}
    assert len(walls) == 1
    assert len(next(iter(walls))) >= 30
    assert blank_scene(small_rig, ViewOptions(clutter=30), seed=5).surfaces[0].paint in walls


def test_a_target_too_long_for_the_picture_is_refused(small_rig):
    rig = replace(small_rig, target=CollinearTarget((0.0, 900.0, 2000.0)))
    with pytest.raises(InputError, match="use a shorter target"):
        picture_tasks(rig, 1, 0)


def test_an_impossible_tilt_is_refused(small_rig):
    """The projector stands 30° off the camera: no strip is square to both."""
    with pytest.raises(InputError, match="tilted by up to 2°"):
        picture_tasks(small_rig, 0, 1, options=ViewOptions(max_tilt_deg=2.0))
