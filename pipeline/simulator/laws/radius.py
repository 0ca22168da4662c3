"""Checks of the laws of the radius error: laser, camera, windows, with the traced ring."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.physics.catalogue import EFFECTS
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.parts import with_laser
from pipeline.simulator.effects.switch import Switch, typical_switch
from pipeline.simulator.laws.bench import RADII_MM, bench_truth
from pipeline.simulator.laws.check import Check
from pipeline.simulator.laws.closed_form import LAWS, mended_tube_tilt
from pipeline.simulator.laws.harmonics import exponent, harmonic, strongest
from pipeline.simulator.laws.trace import TracedRing, trace_ring

# Effects whose radius error the notes give in closed form; the first quantity sizes them.
_CHECKED = (
    "laser_tilt", "laser_cone", "baseline", "beam_decentre", "sheet_waviness", "principal_point",
    "focal_scale", "radial_distortion", "sensor_tilt", "pixel_aspect", "pupil_shift", "housing_glass",
    "tube_wedge", "tube_tilt", "dome_axial", "dome_lateral", "outside_index", "ovality",
)  # fmt: skip
# Of the size: laws of first order leave out terms of the size's square, at most 1.5 % at typical sizes.
SHARE = 0.02
# The notes' own words where the catalogue has the law that holds.
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
    """Check the viewing ray's part of the tilted tube, for which the notes give size and exponent."""
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
