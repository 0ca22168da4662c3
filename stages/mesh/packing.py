"""Finished tiles put one after the other on the disk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.arrays import Byte
from pipeline.artefacts.model import MeshTile, PackedTiles
from pipeline.machine.scratch import Scratch, Spool

_ARRAYS: dict[str, tuple[str, tuple[int, ...]]] = {
    "vertex_p": ("f4", (3,)), "normal_p": ("f4", (3,)), "uv": ("f4", (2,)), "face": ("i4", (3,)),
    "photo": ("u1", ()), "level": ("u1", ()),
}  # fmt: skip


@dataclass
class TilePacker:
    """Takes tiles in order of distance and forgets them but for their place on the disk."""

    scratch: Scratch
    _spools: dict[str, Spool] = field(init=False)
    _tiles: list[tuple[int, ...]] = field(default_factory=list)
    _distance: list[tuple[float, float]] = field(default_factory=list)
    _variants: tuple[str, ...] = ()
    _palettes: list[Byte] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._spools = {name: self.scratch.spool(*kind) for name, kind in _ARRAYS.items()}
        self._note((0, 0), (0, 0))

    def add(self, tile: MeshTile) -> None:
        """Put a tile on the disk."""
        for name in ("vertex_p", "normal_p", "uv", "face"):
            self._spools[name].append(getattr(tile, name))
        self._spools["photo"].append(tile.photo_bgr.ravel())
        for error in tile.errors:
            self._spools["level"].append(error.level.ravel())
        self._variants = tuple(e.variant for e in tile.errors)
        self._palettes = [e.palette_bgr for e in tile.errors]
        self._distance.append(tile.distance_mm)
        self._note(tile.photo_bgr.shape[:2], tile.errors[0].level.shape)

    def packed(self) -> PackedTiles:
        """Return all tiles."""
        arrays: dict[str, Any] = {name: spool.array() for name, spool in self._spools.items()}
        table = np.array(self._tiles, np.int64)
        return PackedTiles(
            **arrays,
            vertex_start=table[:, 0], face_start=table[:, 1], photo_start=table[:, 2],
            level_start=table[:, 3], photo_px=table[1:, 4:6], level_px=table[1:, 6:8],
            distance_mm=np.array(self._distance, float).reshape(-1, 2), variants=self._variants,
            palette_bgr=np.array(self._palettes, np.uint8).reshape(-1, 256, 3),
        )  # fmt: skip

    def _note(self, photo_px: tuple[int, ...], level_px: tuple[int, ...]) -> None:
        ends = [self._spools[name].count for name in ("vertex_p", "face", "photo", "level")]
        self._tiles.append((*ends, *photo_px, *level_px))
