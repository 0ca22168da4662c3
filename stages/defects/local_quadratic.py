"""A local quadratic regression on points of the wall: the kernel of `stages.defects.surface`."""

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def regress(first, i, j, deviation, sure, cell_s, cell_a, along, around, stiff, least, wanted, out):  # type: ignore[no-untyped-def]
    """Write the 1 mm mean of a local quadratic fit at the ``wanted`` (n, 2) cells into ``out`` (S, A), mm.

    ``first``, ``i``, ``j``, ``deviation``, ``sure`` are as in `stages.defects.surface.DeviationPoints`;
    ``cell_s``, ``cell_a``, mm, is the size of a cell, ``along``, ``around``, mm, 1 σ of the kernel.
    ``stiff``, mm⁴, holds the curvature along the pipe to zero. Cells near fewer than ``least`` points stay as
    they are.
    """
    rows, columns = out.shape
    reach_s = int(np.ceil(2.5 * along / cell_s))
    reach_a = min(int(np.ceil(2.5 * around / cell_a)), columns // 2 - 1)
    normal, right = np.zeros((6, 6)), np.zeros(6)
    for row, column in wanted:
        count = 0
        before = after = False
        # Sums of weight × sᵃ qᵇ, named m followed by a and b (d: times the deviation), for the normal
        # equations.
        m00 = m10 = m01 = m20 = m11 = m02 = m30 = m21 = m12 = m03 = m40 = m31 = m22 = m13 = m04 = 0.0
        d00 = d10 = d01 = d20 = d11 = d02 = 0.0
        for r in range(max(0, row - reach_s), min(rows, row + reach_s + 1)):
            for c in range(column - reach_a, column + reach_a + 1):
                cell = r * columns + c % columns
                for k in range(first[cell], first[cell + 1]):
                    s = (i[k] - row) * cell_s
                    q = j[k] - column
                    q = (q - columns * np.rint(q / columns)) * cell_a
                    w = sure[k] * np.exp(-0.5 * ((s / along) ** 2 + (q / around) ** 2))
                    ws, wq, wd = w * s, w * q, w * deviation[k]
                    wss, wsq, wqq = ws * s, ws * q, wq * q
                    m00, m10, m01, m20, m11, m02 = (
                        m00 + w,
                        m10 + ws,
                        m01 + wq,
                        m20 + wss,
                        m11 + wsq,
                        m02 + wqq,
                    )
                    m30, m21, m12, m03 = m30 + wss * s, m21 + wss * q, m12 + wqq * s, m03 + wqq * q
                    ss, sq, qq = s * s, s * q, q * q
                    m40, m31, m22, m13, m04 = (
                        m40 + wss * ss, m31 + wss * sq, m22 + wss * qq, m13 + wqq * sq, m04 + wqq * qq
                    )  # fmt: skip
                    d00, d10, d01 = d00 + wd, d10 + wd * s, d01 + wd * q
                    d20, d11, d02 = d20 + wd * ss, d11 + wd * sq, d02 + wd * qq
                    count += 1
                    before = before or s <= 0.0
                    after = after or s >= 0.0
        if count < least or not (before and after):
            continue
        # One by one: assigned as rows of numbers, they took more than half of the time to compile this.
        right[0], right[1], right[2], right[3], right[4], right[5] = d00, d10, d01, d20, d11, d02
        normal[0, 0], normal[0, 1], normal[0, 2] = m00, m10, m01
        normal[0, 3], normal[0, 4], normal[0, 5] = m20, m11, m02
        normal[1, 1], normal[1, 2], normal[1, 3], normal[1, 4], normal[1, 5] = m20, m11, m30, m21, m12
        normal[2, 2], normal[2, 3], normal[2, 4], normal[2, 5] = m02, m21, m12, m03
        normal[3, 3], normal[3, 4], normal[3, 5] = m40, m31, m22
        normal[4, 4], normal[4, 5], normal[5, 5] = m22, m13, m04
        weight = normal[0, 0]
        for a in range(6):
            normal[a, a] += 1e-4 * weight
        normal[3, 3] += stiff
        _solve(normal, right)
        # mean of x² over a millimetre about its middle is 1 / 12
        out[row, column] = right[0] + (right[3] + right[5]) / 12.0


@numba.njit(cache=True, nogil=True)
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve a positive definite system in place by Cholesky's method, from the upper triangle."""
    n = len(right)
    for a in range(n):
        for k in range(a):
            share = matrix[k, a] / matrix[k, k]
            for b in range(a, n):
                matrix[a, b] -= share * matrix[k, b]
            right[a] -= share * right[k]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            right[a] -= matrix[a, b] * right[b]
        right[a] /= matrix[a, a]
