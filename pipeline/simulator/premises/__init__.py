"""Premises: conditions that a scene must meet to show its effects, checked before and after rendering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float
from pipeline.errors import UnusableError
from pipeline.recording.base import Illumination
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.instrument import TrueSensor
from pipeline.simulator.render import Renderer, renderer_of
from pipeline.simulator.truth import SceneTruth

STAGE = "simulate"


@dataclass(frozen=True)
class Premise:
    """What was checked.

    Attributes
    ----------
    name : str
        As in "markers decoded in a lit frame".
    measured, limit : float
        In ``unit``; the premise holds when ``measured`` is at least, or where ``at_most`` at most, the limit.
    unit : str
    at_most : bool
    frames : tuple of int
        Frames that were examined.
    hint : str
        What to change in the scene when it does not hold.
    """

    name: str
    measured: float
    limit: float
    unit: str = ""
    at_most: bool = False
    frames: tuple[int, ...] = ()
    hint: str = ""

    @property
    def holds(self) -> bool:
        """Whether the scene may be rendered, or the recording be passed on."""
        return self.measured <= self.limit if self.at_most else self.measured >= self.limit

    @property
    def bound(self) -> str:
        """The limit in words."""
        return f"at {'most' if self.at_most else 'least'} {self.limit:g} {self.unit}".rstrip()

    @property
    def text(self) -> str:
        """Measured value and limit, as text."""
        return f"{self.measured:.4g} {self.unit} ({self.bound})"

    @property
    def record(self) -> dict[str, object]:
        """For truth.json."""
        return {
            "name": self.name,
            "measured": float(f"{self.measured:.6g}"),
            "bound": self.bound,
            "holds": self.holds,
            "frames": list(self.frames),
        }


def require(premises: Sequence[Premise]) -> tuple[Premise, ...]:
    """Return the premises when all hold.

    Raises
    ------
    UnusableError
        Naming the first that does not, and all others.
    """
    broken = [p for p in premises if not p.holds]
    if broken:
        first, others = broken[0], ", ".join(p.name for p in broken[1:])
        also = f"; these do not hold either: {others}" if others else ""
        raise UnusableError(
            STAGE, f"{first.name}: {first.measured:.4g} {first.unit}".rstrip() + also,
            limit=first.bound, frames=first.frames, hint=first.hint,
        )  # fmt: skip
    return tuple(premises)


# Errors of a stored picture that do not average out over frames: interpolation, rounding, codec.
_FIXED_PX = 0.005
# The same errors for relative light and relative width of the line. Chosen, not measured.
_FIXED_SHAPE = 0.003
# An effect must exceed the noise floor by this factor (3 σ) for a scene to show it.
_TIMES_THE_FLOOR = 3.0
# Of N independent azimuths, a harmonic's amplitude has 1 σ of σ √(2/N); 72 are taken as independent.
_HARMONICS = 36
# Directions around the ring; px on each side of the peak that hold a line of up to 2.5 px (1 σ) whole.
_AZIMUTHS, _REACH_PX = 720, 12
# Light along an azimuth, full scales × px, below which a centroid is not taken. Chosen, not measured.
_FAINT = 0.1
# beyond the picture's edge is black, and not uninitialised memory
_POLAR = cv2.INTER_LINEAR | cv2.WARP_FILL_OUTLIERS


@dataclass(frozen=True)
class SeenRing:
    """What a picture without noise shows along 720 directions from the stated centre.

    Attributes
    ----------
    radius_px : (720,)
        The line's centroid; NaN where it is too faint.
    light, width_px : (720,)
        Its sum, full scales × px, and its 1 σ.
    sigma_px : (720,)
        Of the centroid, from the sensor's noise.
    """

    radius_px: Float
    light: Float
    width_px: Float
    sigma_px: Float


def effect_premises(plain: SceneTruth, switches: Sequence[Switch]) -> list[Premise]:
    """Return the change of the recording by each effect over the noise floor, with the others switched on.

    Effects of the family ``picture`` are left out.

    Parameters
    ----------
    plain : SceneTruth
        The scene without effects.
    switches : sequence of Switch
    """
    full = switch_on(plain, switches)
    frames = _frames(plain)
    seen = _rings(full, frames)
    found = []
    for one in (s for s in switches if s.effect.family != "picture"):
        others = switch_on(plain, [s for s in switches if s is not one])
        without = _rings(others, frames)
        times = max(
            _times_moved(plain, seen, without), _times_reshaped(seen, without), _times_counted(full, others)
        )
        found.append(
            Premise(
                f"{one.name} over the noise floor", times, _TIMES_THE_FLOOR, "times", frames=frames,
                hint="make it larger, or record what shows it: other bores, off-centre, at changing speed",
            )
        )  # fmt: skip
    return found


def _frames(truth: SceneTruth) -> tuple[int, ...]:
    """Return two frames with a line, one of them late, when drifts have taken effect."""
    shown = truth.frames.of(Illumination.LASER, Illumination.BOTH)
    return tuple(sorted({int(shown[len(shown) // 3]), int(shown[-1])})) if len(shown) else ()


def _times_moved(truth: SceneTruth, seen: Sequence[SeenRing], without: Sequence[SeenRing]) -> float:
    """Return the typical shift of the line over the floor of a harmonic's amplitude over the run."""
    if not seen:
        return 0.0
    shift = np.concatenate([a.radius_px - b.radius_px for a, b in zip(seen, without, strict=True)])
    sigma = np.concatenate([a.sigma_px for a in seen])
    lines = len(truth.frames.of(Illumination.LASER, Illumination.BOTH))
    random = float(np.nanmedian(sigma)) / np.sqrt(_HARMONICS * lines)
    return _typical(shift) / float(np.hypot(_FIXED_PX, random))


def _times_reshaped(seen: Sequence[SeenRing], without: Sequence[SeenRing]) -> float:
    """Return the change of the line's total light and width, relative and typical, over the floor."""
    changes = []
    for a, b in zip(seen, without, strict=True):
        for one, other in ((a.light, b.light), (a.width_px, b.width_px)):
            changes.append(_typical(one / other - 1))
    return max(changes, default=0.0) / _FIXED_SHAPE


def _times_counted(full: SceneTruth, others: SceneTruth) -> float:
    """Return the largest error of the odometer's reading over its step."""
    a, b = full.encoder(), others.encoder()
    if a is None or b is None or full.odometer is None or len(a.time_s) != len(b.time_s):
        return 0.0
    step = max(full.odometer.quantum_mm, 0.01)
    return float(np.abs(a.distance_mm - b.distance_mm).max() / step)


def _typical(change: Float) -> float:
    """Return the size of a change as a robust 1 σ: between two near lines a peak may jump."""
    finite = change[np.isfinite(change)]
    return robust_spread(finite) if len(finite) else 0.0


def _rings(truth: SceneTruth, frames: Sequence[int]) -> list[SeenRing]:
    """Return the line that frames would show with the laser alone, as recorded, without noise."""
    laser = np.full(len(truth.frames.frame), Illumination.LASER.value)
    renderer = renderer_of(replace(truth, frames=replace(truth.frames, illumination=laser)))
    return [_ring(renderer, frame) for frame in frames]


def _ring(renderer: Renderer, frame: int) -> SeenRing:
    truth = renderer.truth
    sensor = truth.instrument_at(float(truth.frames.time_s[frame])).sensor
    counted = np.clip(renderer.seen(frame)[..., 1], 0, 1) ** np.float32(sensor.gamma)
    camera = truth.stated.camera
    centre = camera.project(np.array([0.0, 0.0, 1.0])).uv
    size = (int(np.hypot(*camera.image_size) / 2), _AZIMUTHS)
    polar = cv2.warpPolar(counted, size, tuple(map(float, centre)), size[0], _POLAR)
    return _measured(np.asarray(polar, float), sensor)


def _measured(polar: Float, sensor: TrueSensor) -> SeenRing:
    peak = np.clip(polar.argmax(1), _REACH_PX, polar.shape[1] - _REACH_PX - 1)
    near = peak[:, None] + np.arange(-_REACH_PX, _REACH_PX + 1)
    profile = np.take_along_axis(polar, near, 1)
    total = profile.sum(1)
    total = np.where(total < _FAINT, np.nan, total)
    radius = (profile * near).sum(1) / total
    variance = profile / sensor.full_well_e + (sensor.read_noise_e / sensor.full_well_e) ** 2
    away = (near - radius[:, None]) ** 2
    width = np.sqrt((profile * away).sum(1) / total)
    return SeenRing(radius, total, width, np.sqrt((variance * away).sum(1)) / total)
