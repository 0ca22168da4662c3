"""One law held against what was computed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Check:
    """A row of the table of agreement.

    Attributes
    ----------
    name : str
        Of the effect or state.
    mark : str
        The notes' own: ``✓`` checked there, ``○`` derived only, empty for neither.
    law : str
    of : str
        What is compared.
    predicted, computed : float
    unit : str
    tolerance : float
        Absolute, from the second-order terms that the law leaves out.
    harmonic : tuple of int, or None
        The law's and the strongest computed one.
    exponent : tuple of float, or None
        The notes' and the computed one, radius 25.4 to 50.8 mm.
    mended : str
        The law that holds, where the notes' does not.
    mended_value : float or None
        What that predicts.
    """

    name: str
    mark: str
    law: str
    of: str
    predicted: float
    computed: float
    unit: str
    tolerance: float
    harmonic: tuple[int, int] | None = None
    exponent: tuple[float, float] | None = None
    mended: str = ""
    mended_value: float | None = None

    @property
    def agrees(self) -> bool:
        """True if size, harmonic and exponent are the law's."""
        sized = abs(self.computed - self.predicted) <= self.tolerance
        shaped = self.harmonic is None or self.harmonic[0] == self.harmonic[1]
        grown = self.exponent is None or abs(self.exponent[0] - self.exponent[1]) <= EXPONENT_TOLERANCE
        return sized and shaped and grown

    @property
    def mended_agrees(self) -> bool:
        """True if the law put in its place holds."""
        return self.mended_value is not None and abs(self.computed - self.mended_value) <= self.tolerance


# The notes give exponents to two figures, some as the slope in the middle of the range.
EXPONENT_TOLERANCE = 0.03
