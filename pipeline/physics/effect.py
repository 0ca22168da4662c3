"""One known physical effect as the catalogue describes it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class FixedTo(StrEnum):
    """The part or frame that an effect's pattern is fixed to."""

    LASER = "laser"
    CAMERA = "camera"
    PIPE = "pipe"
    GRAVITY = "gravity"
    TIME = "time"


class Channel(StrEnum):
    """Which kind of measurement an effect shows in first."""

    RING = "ring"
    PROFILE = "profile"
    TEXTURE = "texture"
    MOTION = "motion"
    PICTURE = "picture"


@dataclass(frozen=True)
class Quantity:
    """One number that gives an effect's size: the true instrument minus the stated one.

    Attributes
    ----------
    name : str
        With its unit as suffix where it has one, as in ``tilt_deg``.
    unit : str
    typical : float
        A size met in practice.
    low, high : float
        Range within which a scene or a diagnosis may put it.
    meaning : str
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    meaning: str


@dataclass(frozen=True)
class Effect:
    """A known effect.

    Attributes
    ----------
    name : str
        Canonical name.
    family : str
        ``laser``, ``camera``, ``window``, ``pose``, ``photometric`` or ``picture``.
    quantities : tuple of Quantity
        In the order in which a switch takes them.
    harmonic : int or None
        Harmonic in azimuth of the radius error; None where it has no single one.
    radial_exponent : float or None
        d ln |radius error| / d ln radius over 25 to 51 mm with baseline 22 mm.
    fixed_to : FixedTo
    channel : Channel
    time : str
        ``static``, ``drift``, ``periodic``, ``event``, ``speed`` or ``reversal``.
    law : str
        Radius error, apparent minus true.
    typical_mm : float or None
        Radius error at the typical size in a 4 inch pipe (r 50.8, l 22).
    alike : tuple of str
        Effects that one kind of recording may not tell apart from it.
    told_apart_by : str
    """

    name: str
    family: str
    quantities: tuple[Quantity, ...]
    harmonic: int | None
    radial_exponent: float | None
    fixed_to: FixedTo
    channel: Channel
    time: str
    law: str
    typical_mm: float | None
    alike: tuple[str, ...]
    told_apart_by: str

    def quantity(self, name: str) -> Quantity:
        """Return the quantity of that name.

        Raises
        ------
        KeyError
            When the effect has no such quantity.
        """
        found = {q.name: q for q in self.quantities}
        return found[name]
