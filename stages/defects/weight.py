"""Weigh the relief by its noise, as matched filters need it, and correlate it with templates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.ndimage import maximum_filter

from pipeline.adjustment.robust import row_median
from pipeline.arrays import Bool, Complex64, Float
from stages.defects.relief import Relief

_PIECE_MM = 16.0
"""Length around the pipe, mm, of pieces of a row whose median σ bounds that of their cells: twice the width
of defects that only few rings cross; on wider ones, rings lie on a smooth wall (chosen)."""


@dataclass(frozen=True)
class Weighed:
    """A relief prepared for the filters.

    Attributes
    ----------
    signal, weight : (S, A)
        Relief over its variance, mm⁻¹, and one over its variance, mm⁻²; 0 where nothing was measured.
    seen : (S, A) bool
        Where the wall was measured.
    reach : int
        Largest half length of a template, rows.
    """

    signal: Float
    weight: Float
    seen: Bool
    reach: int

    @cached_property
    def signal_spectrum(self) -> Complex64:
        """The Fourier transform of ``signal``, padded with zeros beyond the ends of the pipe."""
        return self._spectrum(self.signal)

    @cached_property
    def weight_spectrum(self) -> Complex64:
        """The Fourier transform of ``weight``, padded with zeros beyond the ends of the pipe."""
        return self._spectrum(self.weight)

    @cached_property
    def seen_spectrum(self) -> Complex64:
        """The Fourier transform of ``seen``, padded with zeros beyond the ends of the pipe."""
        return self._spectrum(self.seen.astype(float))

    def filtered(self, kernel: Float, *spectra: Complex64) -> list[Float]:
        """Return the correlations (S, A) with a kernel: periodic in azimuth, zero beyond the pipe's ends.

        Templates are symmetric about their centre, so that correlation equals convolution.
        """
        rows, columns = self._shape
        padded = np.zeros((rows, columns), np.float32)
        i, j = (np.arange(n) - n // 2 for n in kernel.shape)
        # A template longer than the circumference is wrapped round it.
        np.add.at(padded, np.ix_(i % rows, j % columns), kernel.astype(np.float32))
        of_kernel = rfft2(padded)
        found = (irfft2(spectrum * of_kernel, (rows, columns)) for spectrum in spectra)
        return [np.asarray(f[: len(self.seen)], float) for f in found]

    @property
    def _shape(self) -> tuple[int, int]:
        return next_fast_len(len(self.seen) + self.reach, real=True), self.seen.shape[1]

    def _spectrum(self, image: Float) -> Complex64:
        padded = np.zeros(self._shape, np.float32)
        padded[: len(image)] = image
        return np.asarray(rfft2(padded), np.complex64)


def weighed(relief: Relief, reach: int) -> Weighed:
    """Return the relief as the filters need it; ``reach`` is the largest half length of a template, rows."""
    weight = np.where(relief.seen, 1 / usual_sigma_mm(relief) ** 2, 0.0)
    return Weighed(weight * np.nan_to_num(relief.local_mm), weight, relief.seen, reach)


def usual_sigma_mm(relief: Relief) -> Float:
    """Return 1 σ (S, A) of the relief, in each row at most the largest median of the pieces beside a cell.

    Rings that cross a narrow defect do not lie on one smooth wall, so that σ is larger there. Weighed with
    it, a defect would hide itself from the search.
    """
    count = max(1, round(2 * np.pi * relief.radius_mm / _PIECE_MM))
    pieces = np.array_split(relief.sigma_mm, count, axis=1)
    median = np.stack([row_median(piece) for piece in pieces], -1)
    # Where noise is larger behind a part of the window, pieces at its border count as noisy.
    size = 2 * round(_PIECE_MM / 2 / relief.cell_mm[0]) + 1, 3
    bound = maximum_filter(np.nan_to_num(median), size, mode=("nearest", "wrap"))
    around = np.repeat(bound, [piece.shape[1] for piece in pieces], axis=1)
    return np.minimum(relief.sigma_mm, np.maximum(around, _lasting_sigma_mm(relief)))


def _lasting_sigma_mm(relief: Relief) -> Float:
    """Return the median σ (S, A) along the pipe: behind a spot of the window it stays large, in a pit not."""
    rows = len(relief.sigma_mm)
    pieces = np.array_split(relief.sigma_mm, max(1, round(rows * relief.cell_mm[0] / _PIECE_MM)))
    median = np.stack([row_median(piece.T) for piece in pieces])
    return np.repeat(np.nan_to_num(median), [len(piece) for piece in pieces], axis=0)
