"""Pictures of a scene as the rig's camera takes them.

Only tiles that an exact edge or the laser line touches are sampled finely; the rest is
sampled once a pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.simulation.light import SheetOfLight, camera_view
from sheetoflight.simulation.paint import Chart, Paint
from sheetoflight.simulation.rays import RayGrid, ray_grid
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.samples import Samples, Tile, blur_border, tiles
from sheetoflight.simulation.scene import Scene, Surface

Picture = NDArray[np.uint8] | NDArray[np.uint16]

_EDGE_ON = 1e-6


@dataclass(frozen=True)
class RenderOptions:
    """How a picture is lit, focused and recorded. Brightness 1 is the sensor's full scale.

    Parameters
    ----------
    ambient_level : float
        Brightness of white paint in ambient light.
    ambient_gradient : (float, float)
        Relative change of the ambient light from the middle to the right and lower edge.
    vignetting : float
        Share of all light that is lost in the corners; it grows with the squared radius.
    laser_level : float
        Brightness the laser adds to white paint lit squarely at `laser_reference_mm` from the
        projector, on the sheet's middle and in perfect focus.
    laser_reference_mm : float
    sheet_sigma_mm : float
        Standard deviation of the light's profile across the sheet, mm.
    defocus_px : float
        Standard deviation of the lens blur, px.
    supersampling : int
        Samples along each side of a pixel.
    tile_px : int
        Side of the tiles the picture is worked in.
    noise : bool
        Whether photon and read noise are added.
    full_well_e : float
        Electrons at full scale.
    read_noise_e : float
        Standard deviation of the read noise, electrons.
    bits : {8, 16}
        Depth of the picture.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    ambient_level: float = 180 / 255
    ambient_gradient: tuple[float, float] = (0.08, -0.05)
    vignetting: float = 0.1
    laser_level: float = 0.7
    laser_reference_mm: float = 1000.0
    sheet_sigma_mm: float = 0.5
    defocus_px: float = 0.7
    supersampling: int = 4
    tile_px: int = 64
    noise: bool = True
    full_well_e: float = 20_000.0
    read_noise_e: float = 10.0
    bits: Literal[8, 16] = 8

    def __post_init__(self) -> None:
        for name in ("laser_reference_mm", "sheet_sigma_mm", "full_well_e"):
            self._demand(name, getattr(self, name) > 0, "above 0")
        for name in ("ambient_level", "laser_level", "defocus_px", "read_noise_e"):
            self._demand(name, getattr(self, name) >= 0, "of 0 or more")
        self._demand("vignetting", 0 <= self.vignetting < 1, "of 0 or more and below 1")
        self._demand("ambient_gradient", sum(map(abs, self.ambient_gradient)) <= 1, "up to 1")
        self._demand("supersampling", self.supersampling >= 1, "of 1 or more")
        self._demand("tile_px", self.tile_px >= 8, "of 8 or more")
        self._demand("bits", self.bits in (8, 16), "of 8 or 16")

    def _demand(self, name: str, holds: bool, allowed: str) -> None:
        if not holds:
            raise InputError(f"{name} is {getattr(self, name)}", f"give a value {allowed}")

    @property
    def coarse_footprint_px(self) -> float:
        """Width of a box as wide (in variance) as the pixel and the lens blur together, px."""
        return math.sqrt(1.0 + 12.0 * self.defocus_px**2)


def render(
    rig: SimulatedRig,
    scene: Scene,
    options: RenderOptions | None = None,
    rng: np.random.Generator | None = None,
    laser: bool = False,
) -> Picture:
    """A picture of the scene.

    Parameters
    ----------
    rig : SimulatedRig
    scene : Scene
    options : RenderOptions, optional
    rng : numpy.random.Generator, optional
        Source of the noise; needed where ``options.noise`` is set.
    laser : bool
        Whether the sheet of light is on.

    Returns
    -------
    (height, width) array of uint8 or uint16
    """
    options = options or RenderOptions()
    return digitised(brightness(rig, scene, options, laser), options, rng)


def brightness(rig: SimulatedRig, scene: Scene, options: RenderOptions, laser: bool) -> Array:
    """Light on each pixel ``(height, width)`` as a share of full scale, without noise."""
    width, height = rig.camera.image_size
    border = blur_border(options.defocus_px)
    grid = ray_grid(rig.camera, border + 1)
    painter = _Painter(rig, scene, options, grid, laser)
    picture = np.empty((height, width))
    for tile in tiles(width, height, options.tile_px, border):
        picture[tile.window] = painter.tile(tile)
    return picture * _vignette(width, height, options.vignetting)


def digitised(
    light: Array, options: RenderOptions, rng: np.random.Generator | None = None
) -> Picture:
    """Grey values of the light on each pixel: photon and read noise, rounding, clipping.

    Raises
    ------
    InputError
        If noise is wanted and no generator is given.
    """
    if options.noise:
        if rng is None:
            raise InputError("noise was asked for without a random generator", "pass rng")
        electrons = rng.poisson(light * options.full_well_e).astype(float)
        electrons += rng.normal(scale=options.read_noise_e, size=light.shape)
        light = electrons / options.full_well_e
    top = 2**options.bits - 1
    grey = np.clip(np.rint(light * top), 0, top)
    if options.bits == 8:
        return grey.astype(np.uint8)
    return grey.astype(np.uint16)


class _Painter:
    """Paints the tiles of one picture."""

    def __init__(
        self,
        rig: SimulatedRig,
        scene: Scene,
        options: RenderOptions,
        grid: RayGrid,
        laser: bool,
    ) -> None:
        self._scene = scene
        self._options = options
        self._grid = grid
        self._views = [(s, camera_view(s)) for s in scene.surfaces if s.plane[1] > _EDGE_ON]
        self._sheet = (
            SheetOfLight(
                rig, options.sheet_sigma_mm, options.laser_level, options.laser_reference_mm
            )
            if laser and options.laser_level > 0
            else None
        )

    def tile(self, tile: Tile) -> Array:
        """Brightness of the pixels of a tile."""
        options = self._options
        around = tile.coarse(self._grid, tile.border, 1.0)
        corners = around.corners
        layers = [_Layer(s, rows, corners, self._sheet) for s, rows in self._views]
        layers = sorted((x for x in layers if x.seen), key=lambda x: -x.depth)
        if not any(layer.needs_care for layer in layers):
            return self._shaded(tile.coarse(self._grid, 0, options.coarse_footprint_px), layers)
        fine = self._shaded(tile.fine(self._grid, options.supersampling), layers)
        return tile.pixels(fine, options.supersampling, options.defocus_px)

    def _shaded(self, samples: Samples, layers: list[_Layer]) -> Array:
        ambient = self._ambient(samples)
        light: Array = self._scene.background * ambient
        for layer in layers:
            surface = layer.surface
            received = ambient
            if self._sheet is not None and layer.lit:
                others = [s for s in self._scene.surfaces if s is not surface]
                received = ambient + self._sheet.on(samples, surface, others)
            if not layer.inside or layer.paint:
                chart = samples.charted(layer.rows)
                seen = received * _reflectance(chart, surface, layer.paint)
                share = 1.0 if layer.inside else _outline(chart, surface)
                light = light + share * (seen - light)
            else:
                light = received * surface.reflectance
        return light

    def _ambient(self, samples: Samples) -> Array:
        across, down = self._options.ambient_gradient
        edge = -1 - self._grid.border
        edge_x, edge_y = self._grid.x[0, edge], self._grid.y[edge, 0]
        tilt = samples.linear(np.array([across / edge_x, down / edge_y, 1.0]))
        return self._options.ambient_level * tilt


class _Layer:
    """A surface as it concerns one tile."""

    def __init__(
        self, surface: Surface, rows: Array, corners: Samples, sheet: SheetOfLight | None
    ) -> None:
        self.surface, self.rows = surface, rows
        self.paint: tuple[Paint, ...] = surface.paint
        depth = corners.linear(rows[2])
        self.seen, self.inside, self.lit = bool(depth.max() > 0), False, False
        self.depth = surface.plane[1] / max(float(depth.mean()), 1e-12)
        if depth.min() > 0:
            self._place(corners.linear(rows[0]) / depth, corners.linear(rows[1]) / depth)
        if self.seen and sheet is not None:
            self.lit = sheet.reaches(corners, surface)

    @property
    def needs_care(self) -> bool:
        """Whether the tile must be sampled finely for this surface's sake."""
        return self.lit or (self.surface.exact and (not self.inside or bool(self.paint)))

    def _place(self, a: Array, b: Array) -> None:
        """Note from the surface coordinates of the tile's corners what lies in the tile."""
        low, high = np.array([a.min(), b.min()]), np.array([a.max(), b.max()])
        half = np.array([self.surface.half_length, self.surface.half_width])
        self.seen = bool((low < half).all() and (high > -half).all())
        self.inside = bool((low > -half).all() and (high < half).all())
        lowest, highest = self.surface.paint_extents
        near = ((low < highest) & (high > lowest)).all(axis=1)
        self.paint = tuple(self.surface.paint[i] for i in np.flatnonzero(near))


def _reflectance(chart: Chart, surface: Surface, paint: tuple[Paint, ...]) -> Array | float:
    reflectance: Array | float = surface.reflectance
    for shape in paint:
        reflectance = reflectance + shape.coverage(chart) * (shape.reflectance - reflectance)
    return reflectance


def _outline(chart: Chart, surface: Surface) -> Array:
    """Share of each sample's footprint that the surface fills."""
    length = chart.band(chart.a, surface.half_length, 1.0, 0.0)
    return length * chart.band(chart.b, surface.half_width, 0.0, 1.0)


def _vignette(width: int, height: int, loss: float) -> Array:
    u, v = (np.arange(n) - (n - 1) / 2 for n in (width, height))
    squared = u**2 + v[:, None] ** 2
    return 1.0 - loss * squared / max(float(squared.max()), 1.0)
