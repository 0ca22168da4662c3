"""Checks of the radius-error laws of laser, camera and windows, and of the ghost's separation."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pipeline.arrays import Float
from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.laws import (
    FOCAL_PX,
    RADII_MM,
    Check,
    TracedRing,
    bench_truth,
    exponent,
    harmonic,
    strongest,
    trace_ring,
)
from pipeline.simulator.laws.closed_form import LAWS, lever_of, mended_tube_tilt
from pipeline.simulator.sheet import sheet_rays
from pipeline.simulator.truth import with_laser

# Effects whose radius error the notes give in closed form; the first quantity is their size.
_CHECKED = (
    "laser_tilt", "laser_cone", "baseline", "beam_decentre", "sheet_waviness", "principal_point",
    "focal_scale", "radial_distortion", "sensor_tilt", "pixel_aspect", "pupil_shift", "housing_glass",
    "tube_wedge", "tube_tilt", "dome_axial", "dome_lateral", "outside_index", "ovality",
)  # fmt: skip
# Tolerance as a share of the size: laws of first order leave out the square of the size, at most 1.5 % of it
# at typical sizes.
SHARE = 0.02
# Laws of the physics notes that are wrong, and for which the catalogue gives the right ones.
_NOTED = {"tube_tilt": "change of d(i)/sin θ; sheet side −(r/l) t χ (1 − 1/n) cos(ψ − ψ₀)"}
_MENDED = {
    "tube_tilt": (
        "(d′(i)/sin i − (r/l) t (1 − 1/n)) χ c₁, sin i = cos θ; "
        "the notes' size and exponent are those of the viewing ray alone",
        mended_tube_tilt,
    )
}


def radius_checks() -> Iterator[Check]:
    """Yield a check of each law at the catalogue's typical size."""
    for name in _CHECKED:
        yield radius_check(typical_switch(name))
    yield _tube_before_camera()


def radius_check(switch: Switch) -> Check:
    """Return the check of an effect's law: amplitude in 4 inch, harmonic, exponent."""
    effect, law = switch.effect, LAWS[switch.name]
    order = effect.harmonic or 0
    if switch.name == "sheet_waviness":
        order = round(switch.quantities["order"])
    rings = [effect_ring(switch, r) for r in RADII_MM]
    sizes = [harmonic(ring.azimuth_rad, ring.error_mm, order) for ring in rings]
    psi = rings[-1].azimuth_rad
    crest = np.exp(1j * order * np.radians(switch.quantities.get("direction_deg", 0.0)))
    stated = effect.radial_exponent
    mended, mended_law = _MENDED.get(switch.name, ("", None))
    predicted = _along(harmonic(psi, law(RADII_MM[-1], psi, **switch.quantities), order), crest)
    words = _NOTED.get(switch.name, effect.law)
    return Check(
        switch.name, "✓", words, f"δr, {_quantity_text(switch)}, 4 inch", predicted,
        _along(sizes[-1], crest), "mm", SHARE * abs(predicted),
        (order, strongest(psi, rings[-1].error_mm)),
        None if stated is None else (stated, exponent(np.array(RADII_MM), np.abs(sizes))),
        mended,
        None if mended_law is None
        else _along(harmonic(psi, mended_law(RADII_MM[-1], psi, **switch.quantities), order), crest),
    )  # fmt: skip


def _tube_before_camera() -> Check:
    """Check the part of the tilted tube that refracts viewing rays; the notes give its size and exponent."""
    switch = typical_switch("tube_tilt")
    crest = np.exp(1j * np.radians(switch.quantities["direction_deg"]))
    sizes = []
    for radius in RADII_MM:
        ring = trace_ring(with_laser(switch_on(bench_truth(radius), [switch]), windows=()))
        sizes.append(_along(harmonic(ring.azimuth_rad, ring.error_mm, 1), crest))
    stated = switch.effect.typical_mm or 0.0
    return Check(
        "tube_tilt", "✓", "d′(i) χ c₁ / sin i, of the viewing ray alone",
        "δr, 1 deg, 4 inch, against the notes' figure", stated, sizes[-1], "mm", SHARE * stated, (1, 1),
        (0.26, exponent(np.array(RADII_MM), np.array(sizes))),
    )  # fmt: skip


def effect_ring(switch: Switch, radius_mm: float, time_s: float = 0.0) -> TracedRing:
    """Return the bench's ring with one effect switched on."""
    return trace_ring(switch_on(bench_truth(radius_mm), [switch]), time_s)


def _quantity_text(switch: Switch) -> str:
    quantity = EFFECTS[switch.name].quantities[0]
    return f"{switch.values[0]:g} {quantity.unit}".strip()


def _along(c: complex, crest: complex) -> float:
    """Return the part of a harmonic that lies along a crest."""
    return float((c * crest.conjugate()).real)


# Radius of a 4 inch pipe, mm.
_R = 50.8
# Rays of the sheet, half a degree apart; harmonics are fitted to all of them.
_RAYS = 720
# Direction of the effects' crest: oblique, so that a law that exchanges x and y fails.
_DIRECTION_DEG = 40.0


def ghost_checks() -> Iterator[Check]:
    """Yield the checks."""
    tilt, cone, wave = math.radians(0.05), math.radians(0.05), 0.3e-3
    lean = Switch("laser_tilt", (0.05, _DIRECTION_DEG))
    yield _separation_check(lean, "tilt −4 r φ c₁", "tilt 0.05°", 1, -4 * tilt)
    yield _separation_check(Switch("laser_cone", (0.05,)), "cone 2 r ε₀", "cone 0.05°", 0, 2 * cone)
    even, odd = (Switch("sheet_waviness", (0.3, float(m), _DIRECTION_DEG)) for m in (2, 3))
    yield _separation_check(even, "even m: 2 r ε_m", "m = 2, 0.3 mrad", 2, 2 * wave)
    yield _separation_check(
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


def _separation_check(
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
    """Check that an effect of the camera does not separate line and ghost."""
    _, apart = separation_mm(Switch("principal_point", (0.5, _DIRECTION_DEG)), _R)
    law, of = "camera-side causes: 0", "principal point off by 0.5 px, 4 inch"
    return Check("ghost_ring", "✓", law, of, 0.0, float(np.abs(apart).max()), "mm", 1e-6)


def separation_mm(switch: Switch, radius_mm: float) -> tuple[Float, Float]:
    """Return azimuths, and the distance along the pipe from the line to the ghost there.

    Sheet rays meet the round wall, are reflected, and meet it again on the other side.
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
    """Return the distance (N,) along rays to the far intersection with the cylinder about the axis."""
    a, b = (np.sum(ray[:, :2] * v[:, :2], 1) for v in (ray, origin))
    c = np.sum(origin[:, :2] ** 2, 1) - radius_mm**2
    return np.asarray((np.sqrt(np.maximum(b * b - a * c, 0.0)) - b) / a)
