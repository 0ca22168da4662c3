"""What the page shows of lit wall: maps of z, and the places with the largest differences."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool, Byte
from pipeline.artefacts.twin import Mismatch, NamedFigure, TwinMap
from stages.twin.compare import BLOCK_PX
from stages.twin.reference import SHOWN_PX, WALL_COLUMNS, BlockSamples, map_of

_SHOWN, _WORST = 8.0, 6
"""Range of the maps in σ, and number of places that are shown."""


def worst_places(samples: BlockSamples | None) -> tuple[Mismatch, ...]:
    """Return the places where lit wall differs most, whether or not something else explains them."""
    if samples is None:
        return ()
    left, found = np.abs(samples.strength), []
    for _ in range(_WORST):
        k = int(np.argmax(left))
        if left[k] <= 0:
            break
        image, wall = samples.near(k)
        found.append(_worst(samples, k, image, wall))
        left = np.where(image | wall, 0.0, left)
    return tuple(found)


def _worst(samples: BlockSamples, k: int, image: Bool, wall: Bool) -> Mismatch:
    at = samples.look(np.arange(len(samples.change)) == k, SHOWN_PX)
    fixed = next((w for w, use in (("image", image), ("wall", wall)) if samples.fixed_to(use) == w), "")
    change, times, nan = float(samples.change[k]), abs(float(samples.strength[k])), float("nan")
    why = {"image": "It stays there in other frames.", "wall": "It moves with the wall."}.get(
        fixed, "Other frames do not show it, or too few see this wall."
    )
    size = NamedFigure("change", change, abs(change) / max(times, 1e-9), "relative")
    place = tuple(NamedFigure(n, v, BLOCK_PX / 2, "px") for n, v in (("u_px", at.u_px), ("v_px", at.v_px)))
    return Mismatch(
        "", "intensity", fixed, place, (size,), nan, nan, nan,
        f"In frame {at.frame} at ({at.u_px:.0f}, {at.v_px:.0f}) the wall is {100 * abs(change):.0f} % "
        f"{'brighter' if change > 0 else 'darker'} than re-rendered, {times:.0f} times the usual difference "
        f"of blocks there. {why}",
        at,
    )  # fmt: skip


def maps_of(samples: BlockSamples | None) -> tuple[TwinMap, ...]:
    """Return maps over the image and over the unrolled wall."""
    if samples is None:
        return ()
    return tuple(TwinMap(order, _picture(samples, order)) for order in ("image", "wall"))


def _picture(samples: BlockSamples, order: str) -> Byte:
    rows = samples.along if order == "wall" else samples.row
    columns = WALL_COLUMNS if order == "wall" else int(samples.column.max()) + 1
    mean, sd = map_of(samples, order, (int(rows.max()) + 1, columns))
    z = np.clip(np.nan_to_num(mean / np.maximum(sd, 1e-12)), -_SHOWN + 0.1, _SHOWN - 0.1)
    return np.where(np.isfinite(mean), 128 + 127 / _SHOWN * z, 0).astype(np.uint8)
