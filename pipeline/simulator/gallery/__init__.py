"""The influence of each catalogue effect on picture, ring and encoder, and the similarity of two effects.

Likeness is |cosine| of the angle between two patterns: of the radius error around the ring or, for effects
without one, of the line's profile or the odometer's reading. No number is entered by hand: all are computed
from renderings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from pipeline.adjustment.robust import root_mean_square
from pipeline.arrays import Float, Float32
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.gallery.scenes import Course, course_of, scene_pair
from pipeline.simulator.laws import RADII_MM, exponent, harmonic, strongest
from pipeline.simulator.render import renderer_of
from pipeline.simulator.truth import SceneTruth

# Window of a centroid, its steps along a radius, and the range around the line in which it is searched.
WINDOW_PX, _STEP_PX, _REACH_PX = 6.0, 0.25, 30.0
# Number of times that the window is centred on the centroid of its light.
_CENTRINGS = 3


class SeenLine(NamedTuple):
    """Moments of the light within `WINDOW_PX` of the line, along each azimuth.

    Attributes
    ----------
    radius_px : (A,)
        Centroid, from the stated centre.
    light : (A,)
        Sum along the radius, full scales × px.
    width_px, skewness : (A,)
        1 σ and third standardised moment.
    """

    radius_px: Float
    light: Float
    width_px: Float
    skewness: Float


def seen_line(picture: Float32, truth: SceneTruth, azimuth_rad: Float) -> SeenLine:
    """Return the line of a picture (H, W), in full scales, along azimuths (A,), rad in the image."""
    rho, grey = unrolled(picture, truth, azimuth_rad, _REACH_PX, _STEP_PX)
    middle = rho[np.argmax(grey, axis=1)]
    weight = grey
    for _ in range(_CENTRINGS):
        weight = grey * (np.abs(rho - middle[:, None]) <= WINDOW_PX)
        middle = np.sum(weight * rho, 1) / np.maximum(np.sum(weight, 1), 1e-12)
    total = np.maximum(np.sum(weight, 1), 1e-12)
    off = rho - middle[:, None]
    variance, third = (np.sum(weight * off**n, 1) / total for n in (2, 3))
    return SeenLine(middle, total * _STEP_PX, np.sqrt(variance), third / variance**1.5)


def unrolled(
    picture: Float32, truth: SceneTruth, azimuth_rad: Float, reach_px: float, step_px: float
) -> tuple[Float, Float]:
    """Return image radii (N,) about where the ring is expected, and the picture there (A, N)."""
    expected = expected_px(truth)
    rho = np.arange(expected - reach_px, expected + reach_px, step_px)
    centre = truth.stated.camera.centre_px
    u, v = (c + rho * f(azimuth_rad)[:, None] for c, f in zip(centre, (np.cos, np.sin), strict=True))
    grey = map_coordinates(spline_filter(picture.astype(float)), [v, u], prefilter=False)
    return rho, np.maximum(grey, 0.0)


def read_radii(line_px: Float, truth: SceneTruth, azimuth_rad: Float) -> Float:
    """Return the radius (A,), mm, that the stated instrument computes for image radii (A,), px."""
    outward = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    point = truth.stated.triangulate(truth.stated.camera.centre_px + line_px[:, None] * outward)
    return np.asarray(np.hypot(point[:, 0], point[:, 1]))


def expected_px(truth: SceneTruth) -> float:
    """Return the image radius, px, at which the stated instrument sees the ring of a centred pipe."""
    place = np.array([truth.facts.nominal_diameter_mm / 2, 0.0, truth.stated.laser.baseline_mm])
    return float(np.linalg.norm(truth.stated.camera.project(place).uv - truth.stated.camera.centre_px))


# Directions around the ring, 2° apart: the catalogue's highest harmonic, 6, has 30 of them a wave.
AZIMUTHS = 180
# Radius errors below a third of a micrometre are errors of the rendering itself.
NOTHING_MM = 3e-4
# Channel of the laser's light in BGR pictures: the stated wavelength is green (520 nm).
_GREEN = 1
# Quantities that every run leaves unknown, with the harmonic of the radius that each changes in all bores.
STATES = {"off-centre probe": 1, "pipe of another radius": 0}
# Typical 1 σ of a frame's light, width and skewness along one azimuth, used as their weights.
_PROFILE_SIGMA = (0.05, 0.05, 0.15)
# Largest number of similar effects that are listed for an effect.
_MOST_ALIKE = 5


@dataclass(frozen=True)
class Residual:
    """What an effect changes around the ring in one bore: with it less without it, over azimuth (A,).

    Attributes
    ----------
    error_mm : (A,)
        Radius as the stated instrument reads the line's centroid.
    light : (A,)
        The line's light, relative.
    width_px, skewness : (A,)
        Of the line's profile.
    """

    error_mm: Float
    light: Float
    width_px: Float
    skewness: Float

    @property
    def rms_mm(self) -> float:
        """Root mean square of the radius error."""
        return root_mean_square(self.error_mm)

    @property
    def largest_mm(self) -> float:
        """Largest radius error, with its sign."""
        return float(self.error_mm[np.argmax(np.abs(self.error_mm))])

    @property
    def profile_rms(self) -> tuple[float, float, float]:
        """Root mean squares of light, width and skewness."""
        return root_mean_square(self.light), root_mean_square(self.width_px), root_mean_square(self.skewness)


@dataclass(frozen=True)
class Exhibit:
    """What one effect does at the size of its switch.

    Attributes
    ----------
    switch : Switch
    scene : SceneTruth
        In 4 inch, without the effect.
    plain, changed : (H, W) float32
        Light of the green channel after lens and sensor, full scales, in 4 inch, without and with it.
    azimuth_rad : (A,)
    residual : mapping of radius, mm, to Residual
    course : Course or None
        The effect over time.
    """

    switch: Switch
    scene: SceneTruth
    plain: Float32
    changed: Float32
    azimuth_rad: Float
    residual: Mapping[float, Residual]
    course: Course | None

    @property
    def name(self) -> str:
        """Of the effect."""
        return self.switch.name

    @property
    def shows_on_ring(self) -> bool:
        """Whether the effect changes the measured radius at all."""
        return max(r.rms_mm for r in self.residual.values()) > NOTHING_MM

    @property
    def harmonic(self) -> int | None:
        """The harmonic, 0 to 6, that is most of the radius error in 4 inch; None where none is."""
        if not self.shows_on_ring:
            return None
        residual = self.residual[max(self.residual)]
        order = strongest(self.azimuth_rad, residual.error_mm)
        size = abs(harmonic(self.azimuth_rad, residual.error_mm, order))
        mean_square = size**2 / (2 if order else 1)
        return order if mean_square >= residual.rms_mm**2 / 2 else None

    @property
    def exponent(self) -> float | None:
        """Slope of ln rms over ln radius, from the smallest to the largest bore; None without an error."""
        sizes = np.array([r.rms_mm for r in self.residual.values()])
        return exponent(np.array(list(self.residual)), sizes) if sizes.min() > NOTHING_MM else None


def exhibit(switch: Switch) -> Exhibit:
    """Render and measure one effect in 2, 3 and 4 inch."""
    azimuth = -np.pi + 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    residual = {}
    for radius in RADII_MM:
        scene, with_effect = scene_pair(switch, radius)
        plain, changed = recorded(scene), recorded(with_effect)
        lines = seen_line(plain, scene, azimuth), seen_line(changed, scene, azimuth)
        residual[radius] = _residual(*lines, scene, azimuth)
    return Exhibit(switch, scene, plain, changed, azimuth, residual, course_of(switch))


def recorded(truth: SceneTruth) -> Float32:
    """Return the green light (H, W) of the scene's frame, clipped and with its gamma, without noise."""
    sensor = truth.instrument.sensor
    renderer = renderer_of(truth)
    if sensor.fixed_pattern > 0:
        return np.asarray(renderer.frame(0)[..., _GREEN] / np.float32(255), np.float32)
    light = np.clip(renderer.seen(0)[..., _GREEN], 0, 1)
    return np.asarray(light**sensor.gamma, np.float32)


def _residual(before: SeenLine, after: SeenLine, scene: SceneTruth, azimuth_rad: Float) -> Residual:
    read = [read_radii(line.radius_px, scene, azimuth_rad) for line in (before, after)]
    return Residual(
        read[1] - read[0],
        after.light / before.light - 1,
        after.width_px - before.width_px,
        after.skewness - before.skewness,
    )


@dataclass(frozen=True)
class Likeness:
    """Another effect or state with a similar pattern: |cosine| in 4 inch alone and over all three bores."""

    name: str
    one_bore: float
    all_bores: float


def likenesses(exhibits: Sequence[Exhibit], least: float = 0.9) -> dict[str, list[Likeness]]:
    """Return for each effect the others that look like it in one bore, the most similar in all three first.

    Radius errors over azimuth are compared. For effects that do not change the radius, the motion less the
    encoder's reading is compared or, where there is none, light, width and skewness of the line. An effect
    with a direction is turned to the direction in which the two are most similar.
    """
    return {e.name: _alike(e, exhibits, least)[:_MOST_ALIKE] for e in exhibits}


def _alike(one: Exhibit, exhibits: Sequence[Exhibit], least: float) -> list[Likeness]:
    found = [_effect_likeness(one, e) for e in exhibits if e is not one and _kind(e) == _kind(one)]
    if one.shows_on_ring:
        found += [_state_likeness(one, name, order) for name, order in STATES.items()]
    return sorted((f for f in found if f.one_bore >= least), key=lambda f: -f.all_bores)


def _kind(exhibit: Exhibit) -> str:
    """Return which pattern of an effect is compared: ``ring``, ``line`` or ``course``."""
    if exhibit.shows_on_ring:
        return "ring"
    return "line" if exhibit.course is None else "course"


def _effect_likeness(one: Exhibit, other: Exhibit) -> Likeness:
    if one.course is not None and other.course is not None and not one.shows_on_ring:
        cosine = float(_cosines(one.course.value_mm[None], other.course.value_mm)[0])
        return Likeness(other.name, cosine, cosine)
    turned = _directed(one) or _directed(other)
    sizes = []
    for radii in ([max(one.residual)], sorted(one.residual)):
        a, b = (_pattern(e, radii) for e in (one, other))
        steps = range(a.shape[1]) if turned else (0,)
        turns = np.stack([np.roll(a, k, axis=1).ravel() for k in steps])
        sizes.append(float(_cosines(turns, b.ravel()).max()))
    return Likeness(other.name, *sizes)


def _state_likeness(one: Exhibit, name: str, order: int) -> Likeness:
    """Return the share of the radius error that one of `STATES` explains, fitted in each bore separately."""
    wave = np.exp(1j * order * one.azimuth_rad)
    basis = np.stack([wave.real, wave.imag] if order else [wave.real], -1)
    taken, whole = {}, {}
    for radius, residual in one.residual.items():
        fitted = basis @ np.linalg.lstsq(basis, residual.error_mm, rcond=None)[0]
        taken[radius], whole[radius] = float(fitted @ fitted), float(residual.error_mm @ residual.error_mm)
    last = max(one.residual)
    shares = taken[last] / whole[last], sum(taken.values()) / sum(whole.values())
    return Likeness(name, *np.sqrt(shares).tolist())


def _pattern(exhibit: Exhibit, radii: Sequence[float]) -> Float:
    """Return the pattern that is compared, (rows, A), over the bores of ``radii``."""
    residuals = [exhibit.residual[r] for r in radii]
    if exhibit.shows_on_ring:
        return np.stack([r.error_mm for r in residuals])
    parts = [(r.light, r.width_px, r.skewness) for r in residuals]
    return np.concatenate([np.stack(p) / np.array(_PROFILE_SIGMA)[:, None] for p in parts])


def _directed(exhibit: Exhibit) -> bool:
    return any(q.name in ("direction_deg", "azimuth_deg") for q in exhibit.switch.effect.quantities)


def _cosines(rows: Float, other: Float) -> Float:
    sizes = np.linalg.norm(rows, axis=1) * np.linalg.norm(other)
    return np.asarray(np.abs(rows @ other) / np.maximum(sizes, 1e-12))
