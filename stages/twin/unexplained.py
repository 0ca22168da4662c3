"""Places of the image that are darker or brighter in all frames, where no single effect is confirmed.

A housing that shades a side nearly completely, for example, leaves hardly any photo behind it: frames show
wall there that is many times as bright as its photo, and no dirt, scatter or drop makes that.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import t

from pipeline.arrays import Bool
from pipeline.artefacts.twin import Look, Mismatch, NamedFigure
from stages.twin.cells import sigmas
from stages.twin.compare import BLOCK_PX
from stages.twin.locate import FALSE_ALARM, LEAST_CHANGE, ImagePlace
from stages.twin.reference import FEWEST_FRAMES, BlockSamples

_SURELY = 2.0
"""σ by which a change must exceed what the photo leaves in all frames of a sound recording: as for dirt."""


def unexplained(place: ImagePlace, samples: BlockSamples | None) -> Mismatch | None:
    """Return a place without a name if blocks of the compared frames confirm that it stays in the image."""
    if samples is None:
        return None
    u, v = ((k + 0.5) * BLOCK_PX for k in (samples.column, samples.row))
    use = np.hypot(u - place.u_px, v - place.v_px) < max(place.radius_px, BLOCK_PX)
    frames = np.unique(samples.frame[use])
    if len(frames) < FEWEST_FRAMES:
        return None
    size, sd = _common(samples, use)
    sure = sigmas(samples.explained("image", use)[frames])
    chance = max(place.probability, float(t.sf(sure, len(frames) - 1)))
    if chance > FALSE_ALARM or size < LEAST_CHANGE + _SURELY * sd:
        return None
    numbers = ("u_px", "v_px", "radius_px")
    where = tuple(NamedFigure(n, getattr(place, n), place.radius_px / 2, "px") for n in numbers)
    said = (
        f"About ({place.u_px:.0f}, {place.v_px:.0f}), within {place.radius_px:.0f} px, the image differs by "
        f"{100 * size:.0f} % (r.m.s.) from the re-rendered one, alike in the {len(frames)} compared frames "
        "that could be judged there, whatever wall passes by. They confirm none of dirt, scatter and a drop "
        "alone: several may be there, a part of the probe may shade the wall, or light other than the lamps' "
        "falls on it, and the photo of the wall was made through it, too."
    )
    nan, look = float("nan"), Look(int(samples.number[0]), place.u_px, place.v_px, 4 * place.radius_px)
    change = NamedFigure("change", size, sd, "relative")
    return Mismatch("", "intensity", "image", where, (change,), chance, nan, nan, said, look)


def _common(samples: BlockSamples, use: Bool) -> tuple[float, float]:
    """Return the r.m.s. change that both halves of the frames share at places of the image, and its 1 σ."""
    cell = np.unique(samples.orders["image"][use], return_inverse=True)[1]
    half, cells = samples.frame[use] % 2, int(cell.max()) + 1
    count, total = (
        np.bincount(2 * cell + half, w, 2 * cells).reshape(-1, 2) for w in (None, samples.change[use])
    )
    known = (count > 0).all(1)
    if known.sum() < 2:
        return 0.0, np.inf
    product = (total[known] / count[known]).prod(1)
    size = float(np.sqrt(max(product.mean(), 0.0)))
    return size, float(product.std(ddof=1) / np.sqrt(len(product)) / max(2 * size, 1e-9))
