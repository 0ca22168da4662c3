"""Checks of the ghost's separation: the sheet's rays mirrored at the wall and followed across the bore."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.arrays import Float
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws.bench import FOCAL_PX, RADII_MM, bench_truth
from pipeline.simulator.laws.check import Check
from pipeline.simulator.laws.closed_form import lever_of
from pipeline.simulator.laws.harmonics import exponent, harmonic, strongest
from pipeline.simulator.sheet import sheet_rays

_R = 50.8
_RAYS = 720
_DIRECTION_DEG = 40.0


def ghost_checks() -> Iterator[Check]:
    """Yield the checks."""
    tilt, cone, wave = math.radians(0.05), math.radians(0.05), 0.3e-3
    yield _check(Switch("laser_tilt", (0.05, _DIRECTION_DEG)), "tilt −4 r φ c₁", "tilt 0.05°", 1, -4 * tilt)
    yield _check(Switch("laser_cone", (0.05,)), "cone 2 r ε₀", "cone 0.05°", 0, 2 * cone)
    even, odd = (Switch("sheet_waviness", (0.3, float(m), _DIRECTION_DEG)) for m in (2, 3))
    yield _check(even, "even m: 2 r ε_m", "m = 2, 0.3 mrad", 2, 2 * wave)
    yield _check(
        odd,
        "odd m: 4 r ε_m",
        "m = 3, 0.3 mrad",
        3,
        4 * wave,
        "odd m: −4 r ε_m c_m, as for the tilt",
        -4 * wave,
    )
    yield _pixels(tilt)
    yield _camera()


def _check(
    switch: Switch, law: str, of: str, order: int, share: float, mended: str = "", mended_share: float = 0.0
) -> Check:
    crest = np.exp(1j * order * math.radians(_DIRECTION_DEG if order else 0.0))
    apart = [separation_mm(switch, r) for r in RADII_MM]
    sizes = [float((harmonic(psi, value, order) * crest.conjugate()).real) for psi, value in apart]
    return Check(
        "ghost_ring", "✓", law, f"separation along the wall, {of}, 4 inch", share * _R, sizes[-1], "mm",
        0.01 * abs(share * _R), (order, strongest(*apart[-1])),
        (1.0, exponent(np.array(RADII_MM), np.array(sizes))),
        mended, mended_share * _R if mended else None,
    )  # fmt: skip


def _pixels(tilt: float) -> Check:
    """Check the notes' 1.06 px for a tilt of 0.05°."""
    psi, apart = separation_mm(Switch("laser_tilt", (math.degrees(tilt), _DIRECTION_DEG)), _R)
    computed = abs(harmonic(psi, apart, 1)) * (_R / 22.0) * FOCAL_PX / lever_of(_R)
    return Check(
        "ghost_ring",
        "✓",
        "tilt 0.05° → 1.06 px",
        "separation in the image, 4 inch",
        1.06,
        computed,
        "px",
        0.01,
    )


def _camera() -> Check:
    """Check that a cause in the camera does not part line and ghost."""
    _, apart = separation_mm(Switch("principal_point", (0.5, _DIRECTION_DEG)), _R)
    law, of = "camera-side causes: 0", "principal point off by 0.5 px, 4 inch"
    return Check("ghost_ring", "✓", law, of, 0.0, float(np.abs(apart).max()), "mm", 1e-6)


def separation_mm(switch: Switch, radius_mm: float) -> tuple[Float, Float]:
    """Return azimuths and by how much farther ahead the ghost meets the wall than the line does there.

    Sheet rays meet the round wall, are mirrored, and meet it again on the other side.
    """
    laser = switch_on(bench_truth(radius_mm), [switch]).instrument.laser
    around = -np.pi + 2 * np.pi * np.arange(_RAYS) / _RAYS
    origin, ray = sheet_rays(laser, around)
    lit = origin + _way(origin, ray, radius_mm)[:, None] * ray
    normal = lit * np.array([1.0, 1.0, 0.0]) / radius_mm
    onward = ray - 2 * np.sum(ray * normal, 1, keepdims=True) * normal
    ghost = lit + _way(lit, onward, radius_mm)[:, None] * onward
    line, psi = np.arctan2(lit[:, 1], lit[:, 0]), np.arctan2(ghost[:, 1], ghost[:, 0])
    order = np.argsort(line)
    return psi, ghost[:, 2] - np.interp(psi, line[order], lit[order, 2], period=2 * np.pi)


def _way(origin: Float, ray: Float, radius_mm: float) -> Float:
    """Return the farther way (N,) of rays to the cylinder about the axis."""
    a, b = (np.sum(ray[:, :2] * v[:, :2], 1) for v in (ray, origin))
    c = np.sum(origin[:, :2] ** 2, 1) - radius_mm**2
    return np.asarray((np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a)
