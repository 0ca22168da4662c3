"""The result of one test of the line's light."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.arrays import Float
from pipeline.physics.effect import FixedTo
from stages.diagnose.agreement import Agreement

# A finding needs p below one in ten million by the estimate's own σ, and this many σ of the errors that image
# formation may cause. Debt: data/debts.md.
FOUND_P, FOUND_Z = 1e-7, 6.0
# Effects that are tested at fixed pixels or azimuths of the image while the pipe moves past.
_OF_THE_SENSOR = frozenset({"fixed_pattern", "pixel_locking", "dust", "vignetting", "saturation"})


@dataclass(frozen=True)
class Size:
    """One measured quantity, true minus stated, with its 1 σ (random and what image formation may do)."""

    name: str
    unit: str
    value: float
    sigma: float


@dataclass(frozen=True)
class Curve:
    """What was measured and what the effect predicts, to be drawn: (K,) each."""

    title: str
    x_label: str
    y_label: str
    x: Float
    measured: Float
    sigma: Float
    predicted: Float


@dataclass(frozen=True)
class Finding:
    """The test of one effect.

    Attributes
    ----------
    effect : str
        Name of the catalogue.
    z : float
        Estimate over its σ, image formation's own doing included.
    p_value : float
        Two-sided, with the degrees of freedom σ was estimated with; 1 when it could not be tested.
    sizes : tuple of Size
        Quantities of the catalogue; empty when the test gives none.
    fixed_to : FixedTo or None
        As far as this test itself measures it.
    time : str or None
        Likewise.
    statement : str
        What was seen, with numbers.
    curve : Curve or None
    shift_px : (F, S) or None
        By how much the line is found too far out for it, per frame and sector of the evidence.
    confirms : tuple of Size
        Sizes of other effects that this measurement gives independently, named ``effect.quantity``.
    alike : tuple of str
        Effects that would show the same here.
    agreements : tuple of Agreement
        What the two halves of the frames say of each other.
    """

    effect: str
    z: float
    p_value: float
    sizes: tuple[Size, ...]
    fixed_to: FixedTo | None
    time: str | None
    statement: str
    curve: Curve | None = None
    shift_px: Float | None = None
    confirms: tuple[Size, ...] = ()
    alike: tuple[str, ...] = ()
    agreements: tuple[Agreement, ...] = ()

    @property
    def found(self) -> bool:
        """Whether it is beyond what image formation and chance do."""
        return self.p_value < FOUND_P and abs(self.z) > FOUND_Z


def finding(
    name: str, z: float, p_value: float, sizes: tuple[Size, ...], statement: str, curve: Curve | None = None,
    shift_px: Float | None = None, confirms: tuple[Size, ...] = (), alike: tuple[str, ...] = (),
) -> Finding:  # fmt: skip
    """Return the finding of an effect; what it is fixed to is stated only where the test shows that."""
    fixed_to = FixedTo.CAMERA if name in _OF_THE_SENSOR else None
    time = "speed" if name == "motion_blur" else None
    return Finding(name, z, p_value, sizes, fixed_to, time, statement, curve, shift_px, confirms, alike)


def untestable(name: str, why: str) -> Finding:
    """Return the finding of an effect that these frames cannot show."""
    return finding(name, 0.0, 1.0, (), why)
