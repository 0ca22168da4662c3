"""What people look at: the textured mesh and the error-colour overlays of a measured wall.

Lengths mm, azimuths rad, pipe frame P. Overlays are stored as levels of a palette: level 0 is "not measured",
levels 1 to 255 run linearly from ``low_mm`` to ``high_mm``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Byte, Float, Float32, Int

Face = NDArray[np.int32]

VARIANTS = ("photo", "deviation", "uncertainty", "misalignment")


@dataclass(frozen=True)
class Overlay:
    """One quantity over the wall, as error colours.

    Attributes
    ----------
    name : str
        Stem of its picture's file.
    title : str
        What is shown, in words.
    colour_map : str
        Name of the map, for the legend.
    low_mm, high_mm : float
        Values of levels 1 and 255; what lies beyond is shown in the end colours.
    beyond : float
        Fraction of the measured cells that lie beyond.
    palette_bgr : (256, 3) uint8
        Colour of each level; level 0 is grey.
    level : (S, A) uint8
        The wall, rows along distance and columns along azimuth.
    """

    name: str
    title: str
    colour_map: str
    low_mm: float
    high_mm: float
    beyond: float
    palette_bgr: Byte
    level: Byte

    @property
    def bgra(self) -> Byte:
        """(S, A, 4) flat picture; alpha 0 where nothing was measured."""
        return self.colours_of(self.level)

    def colours_of(self, level: Byte) -> Byte:
        """Return levels (S, A) as colours (S, A, 4), alpha 0 where nothing was measured."""
        alpha = np.where(level > 0, 255, 0).astype(np.uint8)
        return np.dstack([self.palette_bgr[level], alpha])


@dataclass(frozen=True)
class Overlays:
    """Error colours of the wall on the grid of its radius map.

    Attributes
    ----------
    distance_mm : (S,)
        Rows' centres, uniform.
    azimuth_rad : (A,)
        Columns' centres, uniform, first −π.
    reference_radius_mm : (A,)
        Radius of the fitted pipe that ``deviation`` refers to.
    nominal_radius_mm : float
    deviation : Overlay
        Radius minus the fitted pipe, positive into the wall.
    deviation_nominal : Overlay
        Radius minus the nominal pipe.
    uncertainty : Overlay
        1 σ of the radius.
    misalignment : Overlay
        Radius without correction of the laser's misalignment minus radius with it.
    """

    distance_mm: Float
    azimuth_rad: Float
    reference_radius_mm: Float
    nominal_radius_mm: float
    deviation: Overlay
    deviation_nominal: Overlay
    uncertainty: Overlay
    misalignment: Overlay

    @property
    def pictures(self) -> tuple[Overlay, ...]:
        """All overlays, in the order in which people should read them."""
        return (self.deviation, self.deviation_nominal, self.uncertainty, self.misalignment)

    def of_variant(self, variant: str) -> Overlay:
        """Return the overlay that a material variant of the model shows."""
        found: Overlay = getattr(self, variant)
        return found


@dataclass(frozen=True)
class ErrorTexture:
    """An overlay on a mesh tile's UV atlas: levels (h, w) and the palette (256, 3) BGR they index."""

    variant: str
    palette_bgr: Byte
    level: Byte


@dataclass(frozen=True)
class MeshTile:
    """A stretch of the model with its own UV atlas; one primitive with one set of textures.

    Attributes
    ----------
    vertex_p, normal_p : (V, 3) float32
        Positions, mm, and unit normals toward the inside of the pipe, in P.
    uv : (V, 2) float32
        Texture coordinates in [0, 1], (0, 0) at the top left corner of the texture. Vertices on the border of
        charts are repeated for each chart.
    face : (T, 3) int32
        Counter-clockwise seen from inside.
    photo_bgr : (H, W, 3) uint8
        Colours as recorded; grey where nothing was textured.
    errors : tuple of ErrorTexture
        On the same UV, possibly coarser.
    distance_mm : (float, float)
        Where along the pipe it begins and ends.
    """

    vertex_p: Float32
    normal_p: Float32
    uv: Float32
    face: Face
    photo_bgr: Byte
    errors: tuple[ErrorTexture, ...]
    distance_mm: tuple[float, float]


@dataclass(frozen=True)
class PackedTiles:
    """All tiles of a model in a few long arrays, so that a long pipe need not be held in memory.

    Attributes
    ----------
    vertex_p, normal_p : (V, 3) float32
    uv : (V, 2) float32
    face : (T, 3) int32
        Vertices counted within the tile.
    photo, level : (B,) uint8
        Pixels of the photo textures and of the error textures, one tile after the other.
    vertex_start, face_start, photo_start, level_start : (n + 1,) int
        Where the parts of each tile begin.
    photo_px, level_px : (n, 2) int
        Height and width of the textures; a tile's error textures are all of one size.
    distance_mm : (n, 2)
    variants : tuple of str
        Of the error textures, in their order.
    palette_bgr : (E, 256, 3) uint8
    """

    vertex_p: Float32
    normal_p: Float32
    uv: Float32
    face: Face
    photo: Byte
    level: Byte
    vertex_start: Int
    face_start: Int
    photo_start: Int
    level_start: Int
    photo_px: Int
    level_px: Int
    distance_mm: Float
    variants: tuple[str, ...]
    palette_bgr: Byte

    @property
    def count(self) -> int:
        """Number of tiles."""
        return len(self.photo_px)

    def tile(self, number: int) -> MeshTile:
        """Return a tile, its arrays views of the long ones."""
        vertex, face, photo = (
            slice(int(start[number]), int(start[number + 1]))
            for start in (self.vertex_start, self.face_start, self.photo_start)
        )
        low, high = self.distance_mm[number]
        return MeshTile(
            self.vertex_p[vertex], self.normal_p[vertex], self.uv[vertex], self.face[face],
            self.photo[photo].reshape(*self.photo_px[number], 3), self._errors(number),
            (float(low), float(high)),
        )  # fmt: skip

    def _errors(self, number: int) -> tuple[ErrorTexture, ...]:
        level = self.level[self.level_start[number] : self.level_start[number + 1]]
        pictures = level.reshape(len(self.variants), *self.level_px[number])
        return tuple(map(ErrorTexture, self.variants, self.palette_bgr, pictures))


@dataclass(frozen=True)
class TexturedMesh:
    """The wall as a textured mesh.

    Attributes
    ----------
    packed : PackedTiles
        In order of distance. Positions on the border of two tiles agree to the bit.
    surface : str
        ``grid`` or ``poisson``: how the surface was made.
    texel_mm : float
        Size of a photo texel on the wall.
    wall_triangles : int
        Triangles before thinning out.
    decimation_error_mm : float
        Largest distance, as verified, between this surface and what it was made from: the radius map's cells,
        with their noise, or the vertices of a Poisson surface before it was thinned out.
    decimation_rms_mm : float
        Root mean square of the same distances.
    """

    packed: PackedTiles
    surface: str
    texel_mm: float
    wall_triangles: int
    decimation_error_mm: float
    decimation_rms_mm: float

    @property
    def tiles(self) -> tuple[MeshTile, ...]:
        """All tiles in order of distance."""
        return tuple(self.packed.tile(k) for k in range(self.packed.count))

    @property
    def triangles(self) -> int:
        """Triangles of all tiles."""
        return len(self.packed.face)
