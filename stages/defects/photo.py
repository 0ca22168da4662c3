"""Compare the wall's photo at a finding with its surroundings, and with other places around the pipe."""

from __future__ import annotations

import numpy as np

from pipeline.artefacts.measured import WallTexture
from stages.defects.relief import Relief
from stages.defects.segment import Region

# The photo confirms a finding if it is darker or brighter there than at all of 40 places around the pipe: for
# each of the two this happens by chance once in 41 times.
_PLACES = 40


def photo_stands_out(texture: WallTexture, relief: Relief, region: Region) -> bool | None:
    """Whether the photo differs from its surroundings more in the region than at all places beside it.

    None, undecided, for what goes all round the pipe and where there is no photo.
    """
    if region.all_round:
        return None
    turns = np.arange(1, _PLACES + 1) * len(relief.azimuth_rad) // (_PLACES + 1)
    here = abs(darkness(texture, relief, region))
    beside = [abs(darkness(texture, relief, region.turned(int(turn)))) for turn in turns]
    return bool(here > np.nanmax(beside, initial=0.0)) if np.isfinite(here) else None


def darkness(texture: WallTexture, relief: Relief, region: Region) -> float:
    """Return by which fraction the photo is darker inside than in a frame around it; NaN without a photo."""
    margin = max(4, min(region.mask.shape) // 2)
    rows = np.arange(region.row - margin, region.row + region.mask.shape[0] + margin)
    columns = np.arange(region.column - margin, region.column + region.mask.shape[1] + margin)
    s = relief.distance_mm[0] + rows * relief.cell_mm[0]
    psi = relief.azimuth_rad[0] + columns * (relief.azimuth_rad[1] - relief.azimuth_rad[0])
    i = np.rint((s - texture.distance_from_mm) / texture.mm_per_px).astype(int)
    j = np.rint((psi - texture.azimuth_from_rad) / texture.rad_per_px).astype(int)
    j %= max(1, round(2 * np.pi / texture.rad_per_px))
    known = np.ix_((i >= 0) & (i < texture.bgra.shape[0]), j < texture.bgra.shape[1])
    photo = texture.bgra[np.ix_(i[known[0][:, 0]], j[known[1][0]])]
    inside = np.pad(region.mask, margin)[known]
    grey, seen = photo[..., :3].mean(-1), photo[..., 3] > 0
    if not (inside & seen).any() or not (~inside & seen).any():
        return float("nan")
    return float(1 - grey[inside & seen].mean() / max(1.0, float(grey[~inside & seen].mean())))
