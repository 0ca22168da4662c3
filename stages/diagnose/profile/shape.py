"""Whether the line is skewed all round: what a Gaussian fit leaves of it is not the same on both sides."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Float
from stages.diagnose.profile.cells import CORE_REACH, Cells
from stages.diagnose.profile.finding import Finding, finding, regress, untestable

# Half a grey level of compression on one flank of a line 100 levels high, over its whole width.
HERMITE_FLOOR = 1e-3
OF_A_TAIL = ("line_skew", "subsurface")


def cell_skewness(cells: Cells) -> Float:
    """Return the coefficient (N,) of He₃(x) exp(−x²/2) in what a unit Gaussian leaves of the cells.

    Outward positive; NaN where the middle is not seen. A small third cumulant κ₃ gives κ₃ / 6w³. What the fit
    would absorb is removed from the template.
    """
    w = cells.whole
    x = (cells.offset_px - cells.centre_px[w, None]) / cells.width_px[w, None]
    e = np.exp(-0.5 * x * x) * (np.abs(x) < CORE_REACH)
    tangent = np.stack([e, x * e, x * x * e], axis=-1)
    template = (x**3 - 3 * x) * e
    gram = np.einsum("nbi,nbj->nij", tangent, tangent)
    taken = np.linalg.solve(gram, np.einsum("nbi,nb->ni", tangent, template)[..., None])
    template = template - (tangent @ taken)[..., 0]
    out = np.full(len(w), np.nan)
    out[w] = np.sum(template * np.where(e > 0, cells.rest[w], 0.0), axis=1) / np.sum(template**2, axis=1)
    return out


def skew_findings(cells: Cells) -> tuple[Finding, Finding]:
    """Return the findings of `OF_A_TAIL`, light on one side of the line, without sizes.

    The mean skewness alone does not say whether sheet or wall makes it.
    """
    coefficient = cell_skewness(cells)
    mean = regress(np.ones((len(coefficient), 1)), coefficient, cells.block)
    test = mean.test(0, HERMITE_FLOOR)
    if test is None:
        why = "The line's middle is clipped or not seen: its skewness cannot be measured."
        sheet, wall = (untestable(name, why) for name in OF_A_TAIL)
        return sheet, wall
    side = "outside" if test.z > 0 else "inside"
    seen = f"The line has a longer tail on its {side}, {test.z:.1f} σ beyond what compression leaves."
    sheet, wall = (finding(name, test.z, test.p_value, (), seen) for name in OF_A_TAIL)
    return sheet, wall
