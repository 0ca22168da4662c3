"""Findings in a measured wall: sections and defects, and their names in standards.

Lengths mm, azimuths rad in the pipe frame P. Clock positions are hours in [0, 12), 12 o'clock at −y,
clockwise looking forward: azimuth = 30° · clock − 90°.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from pipeline.arrays import Float, Int

# A depth counts as known from 2 σ: with 95 % it is not zero.
_KNOWN_SIGMA = 2.0


class DefectKind(StrEnum):
    """The kind of a defect by its shape alone."""

    PIT = "pit"
    CORROSION = "corrosion"
    GOUGE = "gouge"
    CRACK = "crack"
    DENT = "dent"
    DEPOSIT = "deposit"
    WELD = "weld"

    @property
    def is_metal_loss(self) -> bool:
        """True if the kind removes wall, so that a wall loss and a POF class are defined."""
        return self in (DefectKind.PIT, DefectKind.CORROSION, DefectKind.GOUGE, DefectKind.CRACK)


@dataclass(frozen=True)
class Sections:
    """Cross-sections at uniform stations; every measure has its 1 σ. NaN where too little was seen.

    A calliper diameter is D(ψ) = r(ψ) + r(ψ + π) around the fitted centre of the section's smooth shape.

    Attributes
    ----------
    distance_mm : (K,)
        Centre of the station's slab.
    coverage : (K,)
        Seen fraction of the slab's cells, 0 to 1.
    mean_diameter_mm, min_diameter_mm, max_diameter_mm : (K,)
        Mean, smallest and largest calliper diameter.
    ovality_nominal : (K,)
        (D_max − D_min) / D_nominal.
    ovality_mean : (K,)
        (D_max − D_min) / D_mean.
    ovality_astm_f1216 : (K,)
        Largest |D − D_mean| / D_mean (ASTM F1216, X1.2, as a fraction).
    ovality_harmonic_mm : (K,)
        Amplitude a₂ of the radius' second harmonic.
    major_axis_rad : (K,)
        Azimuth in [0, π) of the largest calliper diameter.
    centre_x_mm, centre_y_mm : (K,)
        Centre of the section relative to the wall's own axis.
    *_sigma : (K,)
        1 σ of each: random part of this station and the calibration's part, which all stations share.
    """

    distance_mm: Float
    coverage: Float
    mean_diameter_mm: Float
    mean_diameter_sigma_mm: Float
    min_diameter_mm: Float
    min_diameter_sigma_mm: Float
    max_diameter_mm: Float
    max_diameter_sigma_mm: Float
    ovality_nominal: Float
    ovality_nominal_sigma: Float
    ovality_mean: Float
    ovality_mean_sigma: Float
    ovality_astm_f1216: Float
    ovality_astm_f1216_sigma: Float
    ovality_harmonic_mm: Float
    ovality_harmonic_sigma_mm: Float
    major_axis_rad: Float
    centre_x_mm: Float
    centre_y_mm: Float
    centre_sigma_mm: Float


@dataclass(frozen=True)
class Defect:
    """One defect of the wall.

    Attributes
    ----------
    id : int
        Number in order of distance, from 1.
    kind : str
        A `DefectKind`.
    distance_from_mm, distance_to_mm : float
    clock_from, clock_to : float
        Hours, clockwise from one to the other; 0 to 12 all round.
    peak_distance_mm, peak_clock : float
        Place of the extreme deviation, where the depth was measured.
    length_mm, width_mm : float
        Extent along the pipe and around it.
    depth_mm, depth_sigma_mm : float
        Extreme deviation from the pipe's own smooth shape, positive into the wall, and its 1 σ.
    wall_loss_percent : float
        Depth over wall thickness for metal loss; NaN for other kinds, or if the thickness is unknown.
    probability : float
        Probability that the finding is real, from the rings that show it and the number of false findings in
        such footage; NaN if only the photo shows it.
    confidence : float
        Probability that the finding is real and of this kind; NaN as above.
    frames : (N,) int
        Frames whose ring touched it.
    outline : (V, 2)
        Closed polygon of (distance mm, azimuth rad); azimuth runs on beyond ±π rather than jumping.
    pof_class : str
        Dimension class of POF 100 for metal loss, else empty.
    pacp_suggestion, en13508_suggestion : str
        Codes that an inspector may choose: suggestions from the shape, not a coded inspection.
    statement : str
        Description and reasons in words.
    """

    id: int
    kind: str
    distance_from_mm: float
    distance_to_mm: float
    clock_from: float
    clock_to: float
    peak_distance_mm: float
    peak_clock: float
    length_mm: float
    width_mm: float
    depth_mm: float
    depth_sigma_mm: float
    wall_loss_percent: float
    probability: float
    confidence: float
    frames: Int
    outline: Float
    pof_class: str
    pacp_suggestion: str
    en13508_suggestion: str
    statement: str


@dataclass(frozen=True)
class Detectable:
    """What the search finds on a stretch of the pipe: nine of ten round defects of a size and depth, or more.

    Attributes
    ----------
    from_mm, to_mm : float
        The stretch, along the pipe.
    ring_spacing_mm : float
        Median distance of neighbouring rings.
    size_mm, depth_mm : float
        The smallest diameter that enough rings cross, and the depth from which it is found; infinite where
        not even large defects are found.
    photo_size_mm : float
        The smallest diameter that one ring crosses: from there on what the photo shows, too, is found.
    measured, photo : float
        Shares of the wall that rings measured, and that the photo shows.
    """

    from_mm: float
    to_mm: float
    ring_spacing_mm: float
    size_mm: float
    depth_mm: float
    photo_size_mm: float
    measured: float
    photo: float


def usual_limit(limits: Sequence[Detectable]) -> Detectable:
    """Return the limit of detection of the longest stretch."""
    return max(limits, key=lambda d: d.to_mm - d.from_mm)


@dataclass(frozen=True)
class Defects:
    """All defects in order of distance, and the sensitivity of the search.

    Attributes
    ----------
    items : tuple of Defect
        Defects that two rings show, or one ring and the photo.
    false_alarm_rate : float
        Expected number of false ones among them: the sum of 1 − probability.
    detectable : tuple of Detectable
        The limits of detection, stretch by stretch in order of distance.
    unconfirmed : tuple of Defect
        Findings that one ring alone shows, or that are more likely false than real: to be checked, not
        counted.
    """

    items: tuple[Defect, ...]
    false_alarm_rate: float
    detectable: tuple[Detectable, ...] = ()
    unconfirmed: tuple[Defect, ...] = ()

    def limit_at(self, distance_mm: float) -> Detectable | None:
        """Return the limit of detection at a distance; at the ends that of the nearest stretch."""
        off = [max(d.from_mm - distance_mm, distance_mm - d.to_mm) for d in self.detectable]
        return self.detectable[off.index(min(off))] if off else None

    @property
    def deepest(self) -> Defect | None:
        """The defect with the largest depth among those whose depth is certainly not zero (2 σ)."""
        known = [d for d in self.items if abs(d.depth_mm) >= _KNOWN_SIGMA * d.depth_sigma_mm]
        return max(known, key=lambda d: abs(d.depth_mm), default=None)


def clock_of_azimuth(azimuth_rad: Float | float) -> Float:
    """Return the clock position (...), hours in [0, 12), of azimuths (...) in P."""
    hours = np.mod(np.degrees(np.asarray(azimuth_rad, float)) / 30 + 3, 12)
    return np.asarray(np.where(hours >= 12, 0.0, hours))


# Angles from the pipe's axis below and above which a crack is called longitudinal or circumferential.
# Chosen.
_LONGITUDINAL, _CIRCUMFERENTIAL = np.radians(30), np.radians(60)

_PACP = {
    DefectKind.PIT: "SCP (surface damage, corrosion)",
    DefectKind.CORROSION: "SCP (surface damage, corrosion)",
    DefectKind.GOUGE: "SZ (surface damage, other)",
    DefectKind.DENT: "DFBR (deformed, bulging round)",
    DefectKind.DEPOSIT: "DAZ (deposits attached, other)",
    DefectKind.WELD: "MGO (general observation: weld bead)",
}
_EN13508 = {
    DefectKind.PIT: "BAF (surface damage)",
    DefectKind.CORROSION: "BAF (surface damage)",
    DefectKind.GOUGE: "BAF (surface damage)",
    DefectKind.CRACK: "BAB (fissure)",
    DefectKind.DENT: "BAA (deformation)",
    DefectKind.DEPOSIT: "BBB (attached deposits)",
    DefectKind.WELD: "BDB (general remark: weld bead)",
}


def pof_class(length_mm: float, width_mm: float, wall_thickness_mm: float | None) -> str:
    """Return the dimension class of a metal loss (POF 100, Specifications and requirements for ILI, 2021).

    A is the wall thickness, but at least 10 mm; L along the pipe, W around it.
    """
    a = max(wall_thickness_mm or 0.0, 10.0)
    long, wide, ratio = length_mm / a, width_mm / a, length_mm / width_mm
    rules = (
        ("general", wide >= 3 and long >= 3),
        ("pinhole", wide < 1 and long < 1),
        ("axial slotting", wide < 1),
        ("circumferential slotting", long < 1),
        ("pitting", wide < 6 and long < 6 and 0.5 < ratio < 2),
        ("axial grooving", ratio >= 2),
        ("circumferential grooving", True),
    )
    return next(name for name, holds in rules if holds)


def pacp_suggestion(kind: DefectKind, direction_rad: float) -> str:
    """Return a PACP code that an inspector may choose."""
    if kind is not DefectKind.CRACK:
        return _PACP[kind]
    if direction_rad < _LONGITUDINAL:
        return "CL (crack, longitudinal)"
    return "CC (crack, circumferential)" if direction_rad > _CIRCUMFERENTIAL else "CS (crack, spiral)"


def en13508_suggestion(kind: DefectKind) -> str:
    """Return an EN 13508-2 main code that an inspector may choose."""
    return _EN13508[kind]
