"""Rendered pictures against measures that share nothing with the renderer."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm, poisson

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import normalised
from sheetoflight.model.camera import Camera
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.render import RenderOptions, brightness, digitised, render
from sheetoflight.simulation.scene import (
    INK,
    WHITE,
    Scene,
    Surface,
    bar_surface,
    facing_direction,
    target_surface,
    wall_surface,
)

EVEN = RenderOptions(ambient_level=0.7, ambient_gradient=(0.0, 0.0), vignetting=0.0, noise=False)
BROWN = (-0.2, 0.08, 0.002, -0.003, 0.0)
ACCURACY_PX = 0.005


def held(rig, direction, middle=(10.0, -5.0, 1000.0), laser=False) -> Surface:
    """The rig's target with its middle at a point, turned to the camera."""
    along, middle = normalised(np.array(direction, dtype=float)), np.array(middle)
    origin = middle - rig.target.length_mm / 2 * along
    return target_surface(rig.target, origin, along, facing_direction(rig, middle, laser))


def crossing_error(options: RenderOptions) -> float:
    """Largest error of a pixel in which edges cross: a quarter of one sample, at the peak of
    the blur; brightness of the brighter side being 1."""
    variance = options.defocus_px**2 + 1 / 12
    return 1 / (2 * np.pi * variance * options.supersampling**2) / 4


def markers(rig, strip: Surface) -> np.ndarray:
    """True image points (M, 2) of a strip's markers."""
    s = rig.target.positions - rig.target.length_mm / 2
    return rig.camera.project(strip.centre + s[:, None] * strip.axes[0])


# --- Where things are -----------------------------------------------------------------------------


@pytest.mark.parametrize("distortion", [(0.0,) * 5, BROWN], ids=["pinhole", "brown"])
def test_grey_centroid_of_a_square_on_disc_is_its_projected_centre(small_rig, distortion):
    """A disc parallel to the picture has a disc as its image; through a lens the centre of
    its image shifts by ``r²/8`` times the lens's second derivative, under 0.004 px here."""
    rig = replace(
        small_rig,
        camera=replace(small_rig.camera, distortion=distortion),
        target=CollinearTarget((0.0, 110.0, 240.0), marker="disc", marker_size_mm=16.0),
    )
    origin, along = np.array([-130.0, 60.0, 1000.0]), normalised(np.array([1.0, -0.5, 0.0]))
    strip = target_surface(rig.target, origin, along, np.array([0.0, 0.0, -1.0]))
    picture = brightness(rig, Scene((strip,), background=WHITE), EVEN, laser=False)
    ink = 1.0 - picture / EVEN.ambient_level
    grid_v, grid_u = np.mgrid[:240, :320]
    for u, v in markers(rig, strip):
        near = np.hypot(grid_u - u, grid_v - v) < 9.0
        share = ink * near
        centroid = [(share * grid_u).sum() / share.sum(), (share * grid_v).sum() / share.sum()]
        np.testing.assert_allclose(centroid, [u, v], atol=ACCURACY_PX)


@pytest.mark.parametrize(
    "direction", [(0.8, 0.5, 0.5), (0.2, -1.0, 0.6), (1.0, 0.05, -0.8)], ids=["a", "b", "c"]
)
def test_quadrant_edges_cross_at_the_marker(small_rig, direction):
    """Each black-white edge is a straight line, found by the balance of light along rows or
    columns – exact for any symmetric blur – and two of them meet at the marker's centre."""
    rig = replace(
        small_rig,
        camera=replace(small_rig.camera, alpha=2300.0, beta=2290.0),
        target=CollinearTarget(marker_size_mm=40.0),
    )
    for position in rig.target.positions:
        along = normalised(np.array(direction))
        origin = np.array([5.3, -7.1, 1000.0]) - position * along
        strip = target_surface(rig.target, origin, along, np.array([0.1, 0.2, -1.0]))
        picture = brightness(rig, Scene((strip,)), EVEN, laser=False)
        middle = position - rig.target.length_mm / 2
        lines = [edge_line(rig, strip, picture, middle, turn) for turn in (np.pi / 4, -np.pi / 4)]
        crossing = np.linalg.solve([normal for normal, _ in lines], [at for _, at in lines])
        truth = rig.camera.project(origin + position * along)
        np.testing.assert_allclose(crossing, truth, atol=ACCURACY_PX)


def edge_line(rig, strip, picture, middle, turn):
    """Line ``normal · uv = offset`` of one edge of a quadrant marker, from the picture alone.

    Truth serves only to say which rows or columns to look along. In each, the light between
    two points inside the quarters on either side gives the edge's place.
    """
    radius = rig.target.marker_size_mm / 2

    def seen(distance, angle):
        at = middle + distance * np.cos(angle), distance * np.sin(angle)
        return rig.camera.project(strip.centre + at[0] * strip.axes[0] + at[1] * strip.axes[1])

    points = []
    for side in (0.0, np.pi):
        near, far = seen(0.5 * radius, turn + side), seen(0.72 * radius, turn + side)
        across = int(abs(far - near)[0] > abs(far - near)[1])  # 0: look along rows
        lo, hi = sorted((near[1 - across], far[1 - across]))
        for line in range(int(np.ceil(lo)), int(np.floor(hi)) + 1):
            share = (line - near[1 - across]) / (far - near)[1 - across]
            guess = round(float((near + share * (far - near))[across]))
            window = np.arange(guess - 6, guess + 7)
            grey = picture[line, window] if across == 0 else picture[window, line]
            ends = grey[0], grey[-1]
            levels = [EVEN.ambient_level * x for x in (INK, WHITE)]
            assert sorted(ends) == pytest.approx(levels, rel=1e-3)
            first = (grey - ends[1]).sum() / (ends[0] - ends[1])
            place = window[0] - 0.5 + first
            points.append((place, line) if across == 0 else (line, place))
    points = np.array(points)
    assert len(points) >= 4
    _, _, vectors = np.linalg.svd(points - points.mean(axis=0))
    return vectors[1], float(vectors[1] @ points.mean(axis=0))


@pytest.mark.parametrize("distortion", [(0.0,) * 5, BROWN], ids=["pinhole", "brown"])
def test_line_centroid_is_the_projected_line(small_rig, distortion):
    """Row by row, the line on a wall lies where sheet and wall meet."""
    rig = replace(small_rig, camera=replace(small_rig.camera, distortion=distortion))
    wall = wall_surface(rig, 1200.0)
    picture = brightness(rig, Scene((wall,)), replace(EVEN, ambient_level=0.0), laser=True)
    normal, distance = wall.plane
    along = normalised(np.cross(normal, rig.light_plane.normal).astype(float))
    middle = np.linalg.solve(
        np.stack([normal, rig.light_plane.normal, along]),
        [distance, rig.light_plane.distance_mm, 0.0],
    )
    line = rig.camera.project(middle + np.linspace(-600.0, 600.0, 5001)[:, None] * along)
    line = line[np.argsort(line[:, 1])]
    rows = np.arange(240)
    truth = np.interp(rows, line[:, 1], line[:, 0])
    centroid = (picture * np.arange(320)).sum(axis=1) / picture.sum(axis=1)
    np.testing.assert_allclose(centroid, truth, atol=ACCURACY_PX)


# --- How bright they are --------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.1])
def test_light_of_a_bar_is_its_area_times_its_reflectance(small_rig, turn):
    """Pixels are area-sampled: nothing is lost or won at edges, whatever their slope.

    The area is that of the polygon of the projected corners. Straight edges are exact; each of
    the four corners errs by at most a quarter of a sample, a sample being 1/16 px².
    """
    middle = np.array([15.3, -12.7, 1000.0])
    along = normalised(np.array([math.cos(turn), math.sin(turn), 0.4 * turn]))
    ends = np.stack([middle - 70.0 * along, middle + 70.0 * along])
    bar = bar_surface(ends, -middle, width_mm=25.0)
    picture = brightness(small_rig, Scene((bar,)), EVEN, laser=False)
    corners = small_rig.camera.project(
        bar.centre
        + np.array([[-1], [1], [1], [-1]]) * bar.half_length * bar.axes[0]
        + np.array([[-1], [-1], [1], [1]]) * bar.half_width * bar.axes[1]
    )
    u, v = corners.T
    area = abs(u @ np.roll(v, 1) - v @ np.roll(u, 1)) / 2
    assert picture.sum() / EVEN.ambient_level == pytest.approx(area, abs=4 * 0.25 / 16)


def test_pixels_agree_with_light_rays_traced_one_by_one(small_rig):
    """Monte Carlo: 40 000 rays a pixel, spread over pixel and blur, each followed to the
    target or the wall and on to the projector. Pinhole camera, so that its rays are K⁻¹.

    Of 60 pixels on edges, line and shadow, each lies within 4.7 standard errors – one of 6 000
    such tests would fail by chance – and the renderer's own error where edges cross.
    """
    rays_per_pixel = 40_000
    rng = np.random.default_rng(20)
    options = replace(EVEN, ambient_level=0.4)
    # the middle of the strip lies in the sheet, so that the line runs along it
    middle = np.array([0.0, 5.0, 950.0])
    normal = small_rig.light_plane.normal
    middle[0] = (small_rig.light_plane.distance_mm - middle[1:] @ normal[1:]) / normal[0]
    strip = held(small_rig, np.cross(normal, [1.0, -0.2, 0.3]), middle, laser=True)
    wall = wall_surface(small_rig, 1500.0)
    picture = brightness(small_rig, Scene((strip, wall)), options, laser=True)
    crossing = crossing_error(options) * picture.max()
    down, across = np.gradient(picture)
    uneven = np.hypot(down, across)
    chosen = rng.choice(uneven.size, 60, p=(uneven / uneven.sum()).ravel())
    v, u = np.unravel_index(chosen, uneven.shape)
    for row, column in zip(v, u, strict=True):
        spread = rng.uniform(-0.5, 0.5, (2, rays_per_pixel))
        spread += rng.normal(scale=options.defocus_px, size=(2, rays_per_pixel))
        light = traced(small_rig, strip, wall, options, column + spread[0], row + spread[1])
        error = light.std() / np.sqrt(rays_per_pixel)
        assert abs(picture[row, column] - light.mean()) < 4.7 * error + crossing, (row, column)


def traced(rig, strip, wall, options, u, v):
    """Brightness along single rays through image points, by vector algebra in space."""
    camera = rig.camera
    rays = np.stack([(u - camera.u0) / camera.alpha, (v - camera.v0) / camera.beta, 0 * u + 1], 1)

    def met(start, directions, surface):
        normal = np.cross(*surface.axes)
        reach = (surface.centre - start) @ normal / (directions @ normal)
        points = start + reach[..., None] * directions
        a, b = surface.axes @ (points - surface.centre).T
        hit = (abs(a) < surface.half_length) & (abs(b) < surface.half_width)
        return points, a, b, reach, hit

    on_strip, a, b, _, hits = met(np.zeros(3), rays, strip)
    on_wall = met(np.zeros(3), rays, wall)[0]
    points = np.where(hits[:, None], on_strip, on_wall)
    reflectance = np.where(hits, strip.reflectance, wall.reflectance)
    for number, position in enumerate(rig.target.positions - rig.target.length_mm / 2):
        inside = hits & (np.hypot(a - position, b) < rig.target.marker_size_mm / 2)
        along = abs(a - position) > abs(b)
        reflectance[inside & (along if number == 0 else ~along)] = INK

    to_points = points - rig.projector_mm
    distance = np.linalg.norm(to_points, axis=1)
    normals = np.where(hits[:, None], np.cross(*strip.axes), np.cross(*wall.axes))
    cosine = abs((normals * to_points).sum(axis=1)) / distance
    _, _, _, reach, shaded = met(rig.projector_mm, to_points, strip)
    shaded &= (reach > 0) & (reach < 1 - 1e-9) & ~hits
    away = points @ rig.light_plane.normal - rig.light_plane.distance_mm
    profile = np.exp(-(away**2) / (2 * options.sheet_sigma_mm**2))
    level = options.laser_level * options.laser_reference_mm / distance
    laser = level * profile * cosine * ~shaded
    return reflectance * (options.ambient_level + laser)


@pytest.mark.parametrize("order", [1, -1], ids=["strip first", "wall first"])
def test_the_nearer_surface_is_seen(small_rig, order):
    """Whatever the order in the scene: white paper in the strip's middle, wall beside it."""
    strip, wall = held(small_rig, (1.0, 0.2, 0.0)), wall_surface(small_rig, 1500.0)
    picture = brightness(small_rig, Scene((strip, wall)[::order]), EVEN, laser=False)
    u, v = np.rint(small_rig.camera.project(strip.centre + 30.0 * strip.axes[0])).astype(int)
    assert picture[v, u] == pytest.approx(EVEN.ambient_level * WHITE)
    assert picture[20, 20] == pytest.approx(EVEN.ambient_level * wall.reflectance)


def test_uneven_light(small_rig):
    """The ambient gradient is a relative change at the edges; vignetting takes light from the
    corners, with the square of the radius."""
    scene = Scene((wall_surface(small_rig, 1500.0),))
    flat = EVEN.ambient_level * scene.surfaces[0].reflectance
    sloping = replace(EVEN, ambient_gradient=(0.2, 0.0))
    picture = brightness(small_rig, scene, sloping, laser=False)
    assert picture[100, -1] / flat == pytest.approx(1.2, abs=0.01)
    assert picture[100, 161] / flat == pytest.approx(1.0, abs=0.001)
    dimmed = brightness(small_rig, scene, replace(EVEN, vignetting=0.3), laser=False) / flat
    assert dimmed[0, 0] == pytest.approx(0.7)
    assert dimmed[119, 159] == pytest.approx(1.0, abs=1e-4)
    half_way = np.hypot(79.5, 0.5) ** 2 / np.hypot(159.5, 119.5) ** 2
    assert 1 - dimmed[119, 239] == pytest.approx(0.3 * half_way, rel=1e-6)


# --- How the sensor records them ------------------------------------------------------------------


@pytest.mark.parametrize("level", [0.05, 0.7])
@pytest.mark.parametrize("bits", [8, 16])
def test_noise_is_photon_and_read_noise(level, bits):
    """Mean and variance of 250 000 pixels against the exact law: a Poisson count of electrons
    plus a normal read noise, rounded to grey values. Each within 4.5 standard errors (the
    variance's by the fourth moment): fails once in 70 000 by chance."""
    options = RenderOptions(bits=bits)
    light = np.full((500, 500), level)
    top = 2**bits - 1
    grey = digitised(light, options, np.random.default_rng(11)).astype(float)

    electrons = level * options.full_well_e
    spread = 8 * np.sqrt(electrons + options.read_noise_e**2)
    counts = np.arange(round(electrons - spread), round(electrons + spread))
    step = options.full_well_e / top
    values = np.arange(int(counts[0] / step), int(counts[-1] / step) + 2)
    upper = norm.cdf((values[:, None] + 0.5) * step, counts, options.read_noise_e)
    chance = np.diff(upper @ poisson.pmf(counts, electrons))
    values = values[1:]
    mean = chance @ values
    variance, fourth = (chance @ (values - mean) ** power for power in (2, 4))

    assert mean / top == pytest.approx(level, abs=0.5 / top)
    shot_and_read = (electrons + options.read_noise_e**2) / step**2
    assert variance == pytest.approx(shot_and_read + 1 / 12, abs=1 / 12)
    error = float(np.sqrt(variance / light.size))
    assert grey.mean() == pytest.approx(mean, abs=4.5 * error)
    error = float(np.sqrt((fourth - variance**2) / light.size))
    assert grey.var() == pytest.approx(variance, abs=4.5 * error)


def test_noise_free_values_are_rounded_shares_of_full_scale():
    light = np.array([[0.0, 0.2, 0.5001, 1.0, 1.7]])
    eight = digitised(light, replace(EVEN, bits=8))
    sixteen = digitised(light, replace(EVEN, bits=16))
    assert eight.dtype == np.uint8
    assert eight.tolist() == [[0, 51, 128, 255, 255]]
    assert sixteen.dtype == np.uint16
    assert sixteen.tolist() == [[0, 13107, 32774, 65535, 65535]]


def test_same_generator_same_picture(small_rig):
    scene = Scene((held(small_rig, (1.0, 0.3, 0.2)), wall_surface(small_rig, 1500.0)))
    options = RenderOptions()
    first, again, other = (
        render(small_rig, scene, options, np.random.default_rng(seed), laser=True)
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_tiles_leave_no_trace(small_rig):
    """Tiles of another size give the same picture. What differs is how soft samples on an edge
    are, by up to 5 %: that share of the error where edges cross."""
    scene = Scene((held(small_rig, (1.0, 0.3, 0.2)), wall_surface(small_rig, 1500.0)))
    one = brightness(small_rig, scene, replace(EVEN, tile_px=320), laser=True)
    bound = 0.05 * crossing_error(EVEN) * one.max()
    for size in (17, 64):
        many = brightness(small_rig, scene, replace(EVEN, tile_px=size), laser=True)
        np.testing.assert_allclose(many, one, rtol=0, atol=bound)


def test_finer_samples_change_little(small_rig):
    """The default sampling is converged to a quarter of a sample at the peak of the blur."""
    scene = Scene((held(small_rig, (1.0, 0.3, 0.2)), wall_surface(small_rig, 1500.0)))
    default, fine = (
        brightness(small_rig, scene, replace(EVEN, supersampling=s), laser=True) for s in (4, 8)
    )
    assert np.abs(default - fine).max() < crossing_error(EVEN) * fine.max()


def test_white_paper_is_recorded_at_180_of_255(small_rig):
    """In the middle of the picture, within what the slope of the ambient light changes there."""
    strip = held(small_rig, (0.2, 1.0, 0.1))
    dark = brightness(small_rig, Scene((strip,)), RenderOptions(vignetting=0.0), laser=False)
    u, v = np.rint(small_rig.camera.project(strip.centre + 20.0 * strip.axes[0])).astype(int)
    assert dark[v, u] * 255 == pytest.approx(180, abs=3)


def test_the_camera_inverse_is_not_used(small_rig, monkeypatch):
    """Or a test of the inverse against pictures would be a circle."""

    def refuse(*_):
        raise AssertionError

    monkeypatch.setattr(Camera, "unproject", refuse)
    monkeypatch.setattr(Camera, "unproject_with_jacobians", refuse)
    rig = replace(small_rig, camera=replace(small_rig.camera, distortion=BROWN, u0=160.123))
    scene = Scene((held(rig, (1.0, 0.3, 0.2)), wall_surface(rig, 1500.0)))
    assert brightness(rig, scene, EVEN, laser=True).max() > 0.5


def test_noise_needs_a_generator(small_rig):
    with pytest.raises(InputError, match="pass rng"):
        render(small_rig, Scene(()), RenderOptions())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bits", 12),
        ("supersampling", 0),
        ("tile_px", 2),
        ("vignetting", 1.0),
        ("full_well_e", 0.0),
        ("sheet_sigma_mm", float("nan")),
        ("ambient_level", -0.1),
        ("ambient_gradient", (0.8, 0.7)),
    ],
)
def test_impossible_options_are_refused(name, value):
    with pytest.raises(InputError, match=f"{name} is "):
        replace(RenderOptions(), **{name: value})
