"""From which frames the wall's photo was made, as far as each frame shows it.

The photo is a mean of measured frames. What changes between them, for example an LED that fails, is therefore
in the photo of the wall that was photographed before or after it: frames differ from the photo by the change
minus its mean over the frames that the photo was made from.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from pipeline.arrays import Float, Int
from stages.twin.laws import TRIED, follows_photo
from stages.twin.reference import BlockSamples
from stages.twin.scene import Ring

REACH_RADII, _NEAREST_RAD = 0.5, 0.2
"""Wall used for the photo on either side of the laser sheet: the default of the stage texture. Least polar
angle at which wall is seen: nearer to the axis no block is all wall."""


def hidden_failures(samples: BlockSamples | None, ring: Ring) -> tuple[str, ...]:
    """Return a sentence if an LED that fails between lit frames would be in the photo of both, unnoticed."""
    if samples is None:
        return ()
    far = ~follows_photo(share_of_frames(samples, ring, samples.number))[TRIED]
    if not far.any():
        return ()
    return (
        f"{far.sum()} of {len(far)} neighbouring pairs of compared lit frames lie so far apart that the "
        "wall's photo was made near each frame itself: if one LED fails or one side darkens in between, the "
        "photo contains it as well, and it may be missed. What to do: compare more frames, with a smaller "
        "premises.withhold and a larger twin.compared.",
    )


def share_of_frames(samples: BlockSamples | None, ring: Ring, frame: Int) -> Float:
    """Return which share of the photo that each of the frames (F,) shows was made from each of them, (F, F).

    Compared frames stand for the measured ones between them. Of the weights of the stage texture, brightness
    and the square of what a parabola leaves at a distance from the laser sheet are followed; pixels per area
    of wall, the laser's band and what that stage leaves out are not. 0 where nothing is known.
    """
    share = np.zeros((len(frame), len(frame)))
    if samples is None:
        return share
    seen = np.flatnonzero(np.isin(frame, samples.number))
    theta = np.maximum(samples.away * np.arctan2(ring.radius_mm, ring.ahead_mm), _NEAREST_RAD)
    from_sheet = 1 / np.tan(theta) - ring.ahead_mm / ring.radius_mm
    bright = np.exp(samples.log_level)
    made = np.maximum(1 - (from_sheet / REACH_RADII) ** 2, 0.0) ** 2 * bright
    whole = np.bincount(samples.orders["wall"], made)
    known = (whole > 0)[samples.orders["wall"]]
    of_cell = _of_cells(samples, made / np.where(known, whole[samples.orders["wall"]], 1.0))
    shown = _of_cells(samples, samples.weight * bright**2 * known)
    shares = (shown.T @ of_cell).toarray() / np.maximum(shown.sum(0), 1e-12)[:, None]
    order = np.searchsorted(samples.number, frame[seen])
    share[np.ix_(seen, seen)] = shares[np.ix_(order, order)]
    return share


def _of_cells(samples: BlockSamples, value: Float) -> csr_array:
    """Return sums (C, F) of values (N,) over the blocks of cells of the wall. Most of them are 0."""
    wall = samples.orders["wall"]
    return csr_array((value, (wall, samples.frame)), (int(wall.max()) + 1, len(samples.number)))
