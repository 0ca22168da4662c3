"""Checks of the laws of the line's light, on profiles made by the renderer."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.surroundings import line_peak
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.laws import ALBEDO, BASELINE_MM, FOCAL_PX, LINE_SIGMA_MM, Check, bench_wall
from pipeline.simulator.laws.closed_form import lever_of, theta_of
from pipeline.simulator.laws.strip import Profiles, exposed_profiles, profiles, strip_truth
from pipeline.simulator.motion import Motion, Signal, constant
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.grid import Wall, WallGrid

# Radius of a 4 inch pipe, mm.
_R = 50.8
_MM_PER_PX = lever_of(_R) / FOCAL_PX
# Relative change of the reflectance a millimetre: the example of the physics notes.
_GRADIENT = 0.2


def light_checks() -> Iterator[Check]:
    """Yield the checks."""
    yield from _albedo()
    yield _slope()
    yield _subsurface()
    yield _tube_ghost()
    yield from _skew()
    yield from _sensor_curve()
    yield _vignetting()
    yield _ambient()
    yield from _blurred()
    yield _speckle()
    yield from _pixels()
    yield _locking()


def _albedo() -> Iterator[Check]:
    """Check that the centroid is pulled by σ_z² ∂_z ln A."""
    wide = Switch("albedo_bias", (0.3,))
    graded = replace(strip_truth(_R), wall=_graded_wall())
    moved = _moved_mm(profiles(graded, wide), profiles(strip_truth(_R), wide))
    predicted = -_R / BASELINE_MM * 0.3**2 * _GRADIENT
    law = "−(r/l) σ_z² ∂_z ln A"
    of = "20 %/mm, σ = 0.3 mm, 4 inch"
    yield Check("albedo_bias", "✓", law, of, predicted, moved, "mm", 0.1 * abs(predicted))


def _slope() -> Check:
    """Check that a glint lies where the wall leans by half the angle between laser and camera."""
    seen = math.degrees(math.pi / 2 - theta_of(_R))
    slopes = -np.arange(0.20, 0.85, 0.05) * seen
    sheen = np.array([_sheen(math.radians(a)) for a in slopes])
    k = int(np.argmax(sheen))
    bend = np.polyfit(slopes[k - 2 : k + 3], sheen[k - 2 : k + 3], 2)
    law, of = "a glint at axial slope i/2", "wall narrowing ahead, 4 inch"
    return Check("slope_bias", "○", law, of, -seen / 2, float(-bend[1] / (2 * bend[0])), "deg", 0.5)


def _sheen(slope_rad: float) -> float:
    truth = replace(strip_truth(_R), wall=_conical_wall(math.tan(slope_rad)))
    dull, glossy = (profiles(truth, Switch("slope_bias", (g,))).grey.sum() for g in (0.0, 0.3))
    return float(glossy / dull)


def _subsurface() -> Check:
    """Check that light which travels in the wall moves the line along the wall by the transport length."""
    plain = profiles(strip_truth(_R))
    transport = 0.05
    moved = _moved_mm(profiles(strip_truth(_R), Switch("subsurface", (transport,))), plain)
    predicted = -_R / BASELINE_MM * transport
    law = "bias ≈ transport length along the wall: −(r/l) × it"
    return Check("subsurface", "○", law, "0.05 mm, 4 inch", predicted, moved, "mm", 0.02 * abs(predicted))


def _tube_ghost() -> Check:
    """Check the place of the second line, from its light in the picture."""
    plain, truth = profiles(strip_truth(_R)), strip_truth(_R)
    incidence = math.pi / 2 - theta_of(_R)
    apart = 2 * 2.0 * math.tan(math.asin(math.sin(incidence) / 1.5))
    ghost = profiles(truth, Switch("tube_ghost", (0.1, apart)))
    copy = Profiles(plain.rho, ghost.grey - plain.grey)
    angle = (copy.centroid().mean()) / FOCAL_PX
    computed = _R / math.tan(angle) - BASELINE_MM
    law = "axial 2 t tan i′ at constant spacing"
    return Check("tube_ghost", "○", law, "t = 2 mm, 4 inch", apart, computed, "mm", 0.02)


def _skew() -> Iterator[Check]:
    """Check the distance of the centroid from the peak."""
    for skewness in (0.3, 0.03):
        profile = replace(strip_truth(_R).instrument.laser.profile, skewness=skewness)
        height = np.linspace(-0.5 * LINE_SIGMA_MM, 0.5 * LINE_SIGMA_MM, 100001)
        peak = float(height[np.argmax(profile.density(height))])
        predicted, computed = (_R / BASELINE_MM * x for x in (LINE_SIGMA_MM * skewness, -peak))
        yield Check(
            "line_skew", "", "bias ~ σ × skew", f"(r/l) × (centroid − peak), skewness {skewness:g}, 4 inch",
            predicted, computed, "mm", 0.06 * predicted,
            mended="of that order, at most half: σ × skewness × 0.34 at 0.3, × ½ as the skewness goes to 0",
            mended_value=predicted * _peak_share(skewness),
        )  # fmt: skip


def _peak_share(skewness: float) -> float:
    """Return (mean − mode) / (σ · skewness) of a normal and an exponential added, from their Fourier form.

    The mode is where the density's derivative, the integral of ω φ̂ sin(ωx + arg φ̂), changes sign.
    """
    tau = (skewness / 2) ** (1 / 3)
    omega = np.linspace(0, 60, 60001)
    size = np.exp(-0.5 * (1 - tau**2) * omega**2) / np.hypot(1, omega * tau)
    phase = np.arctan(omega * tau) - omega * tau

    def slope(x: float) -> float:
        return float(np.sum(omega * size * np.sin(phase - omega * x)))

    return -float(brentq(slope, -0.6, 0.0)) / skewness


def _sensor_curve() -> Iterator[Check]:
    """Check width and shift by gamma, and shift by clipping; the notes' figures are for a skewness of 1."""
    truth, skewed = strip_truth(_R), Switch("line_skew", (1.0,))
    plain, lean = profiles(truth), profiles(truth, skewed)
    for exponent, shift in ((0.8, 0.06), (0.45, 0.34)):
        switch = Switch("gamma", (exponent,))
        widened = float(profiles(truth, switch).sigma().mean() / plain.sigma().mean())
        law, of = "width ∝ 1/√γ", f"γ = {exponent:g}"
        yield Check("gamma", "✓", law, of, exponent**-0.5, widened, "", 0.01)
        moved = abs(float((profiles(truth, skewed, switch).centroid() - lean.centroid()).mean()))
        law, of = "I^γ shifts a skewed profile", f"γ = {exponent:g}, skewness 1"
        yield Check("gamma", "✓", law, of, shift, moved, "px", 0.005)
    dimmed = float(lean.grey.max()) / line_peak(switch_on(truth, [skewed]))
    clipped = profiles(truth, skewed, Switch("saturation", (1.6 / dimmed,)))
    moved = abs(float((clipped.centroid() - lean.centroid()).mean()))
    law, of = "clipping an asymmetric profile shifts it", "peak 60 % over full scale, skewness 1"
    yield Check("saturation", "✓", law, of, 0.035, moved, "px", 0.005)


def _vignetting() -> Check:
    """Check that the centroid moves towards the brighter side."""
    truth, falloff = strip_truth(_R), 2.0
    sharp = profiles(strip_truth(_R, psf_sigma_px=0.0))
    plain = profiles(truth)
    moved = _moved_mm(profiles(truth, Switch("vignetting", (falloff,))), plain)
    sizes = [
        _MM_PER_PX * float(np.mean(p.sigma() ** 2)) * falloff * math.tan(theta_of(_R)) / FOCAL_PX
        for p in (plain, sharp)
    ]
    return Check(
        "vignetting", "✓", "−(S/f) σ_px² ∂ ln V/∂ρ", "cos² θ, 4 inch", sizes[0], moved, "mm", 0.1 * sizes[0],
        mended="+(S/f) σ² ∂ ln V/∂ρ, towards the brighter side, σ of the line before the lens blurs it",
        mended_value=-sizes[1],
    )  # fmt: skip


def _ambient() -> Check:
    """Check the shift by a sloping background within the window ±W of a centroid."""
    truth, half = replace(strip_truth(_R), wall=_graded_wall()), 6.0
    dark, lit = profiles(truth), profiles(truth, Switch("ambient_light", (0.1,)))
    row = len(dark.rho) // 2
    x = np.linspace(-half, half, 2401)
    near = np.flatnonzero(np.abs(dark.rho[row] - dark.centroid()[row]) < 3 * half)
    place = dark.rho[row, near] - dark.centroid()[row]
    line, stray = (CubicSpline(place, grey[row, near])(x) for grey in (dark.grey, lit.grey - dark.grey))
    slope, level = np.polyfit(x, stray, 1)
    area = float(np.trapezoid(line, x))
    predicted = (2 / 3) * slope * half**3 / (area + 2 * level * half)
    both = line + stray
    moved = float(np.trapezoid(x * both, x) / np.trapezoid(both, x) - np.trapezoid(x * line, x) / area)
    law, of = "δρ = (2/3) b′W³ / (Aσ√2π + 2bW)", "10 %, 20 %/mm, W = 6 px"
    return Check("ambient_light", "✓", law, of, predicted, moved, "px", 0.05 * abs(predicted))


def _blurred() -> Iterator[Check]:
    """Check that sideways motion of the camera during the exposure widens the line."""
    rate, exposure, truth = 60.0, 0.01, strip_truth(_R)
    # The camera passes the middle later by half of the additional exposure.
    along = rate * (np.array([-1.0, 1.0]) - exposure / 2)
    moving = replace(truth, motion=Motion(constant(0.0), Signal(np.array([-1.0, 1.0]), along)))
    widths = [
        float(np.mean(profiles(t, Switch("motion_blur", (exposure,))).sigma() ** 2)) for t in (truth, moving)
    ]
    law, of = "width² += (ė t)² cos² ψ / 12", "60 mm/s, 11.5 ms, ψ = 0"
    longer = exposure + truth.instrument.shutter.exposure_s
    predicted = (rate * longer / _MM_PER_PX) ** 2 / 12
    yield Check("motion_blur", "○", law, of, predicted, widths[1] - widths[0], "px²", 0.03 * predicted)


def _speckle() -> Check:
    """Check the scatter of the centroid from row to row."""
    truth, contrast = strip_truth(_R), 0.3
    grain = truth.instrument.laser.speckle_grain_mm
    scatter = float(
        (profiles(truth, Switch("speckle", (contrast,))).centroid() - profiles(truth).centroid()).std()
    )
    lever = lever_of(_R) / math.hypot(_R, BASELINE_MM)
    predicted = lever * contrast * grain / math.pi
    around = _R / (FOCAL_PX * theta_of(_R)) * math.sqrt(1 + 4 * math.pi * 0.7**2)
    wide = contrast * math.sqrt(grain * LINE_SIGMA_MM / (4 * math.sqrt(math.pi)) * min(grain / around, 1.0))
    return Check(
        "speckle", "✓", "σ_r = (S/√(l²+r²)) C λ / (2π sin u)",
        "cells of λ/(2 sin u) = 0.05 mm, C = 0.3, 4 inch", predicted, scatter * _MM_PER_PX, "mm",
        0.3 * predicted,
        mended="for a line wider than the grain g, (r/l) C √(g σ / 4√π) √(g / w), w seen by a pixel around",
        mended_value=_R / BASELINE_MM * wide,
    )  # fmt: skip


def _pixels() -> Iterator[Check]:
    """Check the effects of unequal gains and of dust."""
    truth, unequal = strip_truth(_R), 0.1
    plain = profiles(truth)
    scatter = [_scatter(replace(truth, seed=k), unequal) for k in range(6)]
    law = "0.01–0.5 px, no closed form"
    predicted = unequal * math.sqrt(float(plain.sigma().mean()) / (4 * math.sqrt(math.pi)))
    yield Check(
        "fixed_pattern", "○", f"{law}; here g √(σ/4√π), g the gains' 1 σ", "1 σ of the shift, g = 10 %",
        predicted, float(np.sqrt(np.mean(np.square(scatter)))), "px", 0.15 * predicted,
    )  # fmt: skip
    spotted = profiles(truth, Switch("dust", (0.5, 0.0, 4.0)))
    row = plain.grey.shape[0] // 2
    left = float(spotted.grey[row].sum() / plain.grey[row].sum())
    yield Check("dust", "○", "attenuation", "light left in the spot's middle", 0.5, left, "", 0.01)


def _locking() -> Check:
    """Check the displacement of a line rendered through pixels that shift everything by a sin 2πρ."""
    truth, size = strip_truth(_R), 0.02
    moved = profiles(truth, Switch("pixel_locking", (size,))).centroid() - profiles(truth).centroid()
    predicted = size * math.sin(2 * math.pi * FOCAL_PX * theta_of(_R))
    return Check(
        "pixel_locking", "○", "δρ = a sin 2πρ", f"a = {size:g} px, line of 0.9 px (1 σ), 4 inch",
        predicted, float(moved[len(moved) // 2]), "px", 0.05 * abs(predicted),
        mended="no shift of a line as wide as a pixel: light is drawn aside part by part, not the line",
        mended_value=0.0,
    )  # fmt: skip


def _scatter(truth: SceneTruth, unequal: float) -> float:
    """Return the 1 σ that unequal gains add to the centroids, with rounding subtracted in quadrature."""
    with_gains = exposed_profiles(truth, Switch("fixed_pattern", (unequal,)))
    rounded, exact = exposed_profiles(truth), profiles(truth)
    noise = [float(np.std(p.centroid() - exact.centroid())) for p in (with_gains, rounded)]
    return math.sqrt(max(noise[0] ** 2 - noise[1] ** 2, 0.0))


def _moved_mm(after: Profiles, before: Profiles) -> float:
    return float((after.centroid() - before.centroid()).mean()) * _MM_PER_PX


def _graded_wall() -> Wall:
    """Return the bench's wall with a reflectance whose relative growth is ``_GRADIENT`` per millimetre."""
    wall = bench_wall(_R)
    grid = WallGrid(0.0, 0.1, 601, 64)
    albedo = ALBEDO * np.exp(_GRADIENT * (grid.distance_mm - BASELINE_MM))
    bgr = np.broadcast_to(np.clip(albedo, 0, 1)[:, None, None], (grid.rows, grid.columns, 3))
    return replace(wall, texture=grid, albedo_bgr=np.ascontiguousarray(bgr, np.float32))


def _conical_wall(slope: float) -> Wall:
    """Return a wall whose radius is the bench's where the line meets it, and grows along the pipe."""
    wall = bench_wall(_R)
    radius = np.clip(_R + slope * (wall.shape.distance_mm - BASELINE_MM), 20.0, 80.0)
    return replace(wall, radius_mm=np.repeat(radius[:, None], wall.shape.columns, 1).astype(np.float32))
