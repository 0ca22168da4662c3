"""The open recordings of an independent renderer rendered again from their truth: rings and lit frames.

``python -m tests.benchmarks.bench_resimulation [RECORDING ...]`` prints

bias, rms          recorded less rendered line, px: mean and rms, over frames, of means over 5 degrees
median, typical    the same, robust against outliers at steps and marker edges, which the truth's reflectance,
                   0.24 mm a sample, shows only blurred (1.4826 times the median size)
steady             the part of that rms that all frames share
grain              the effect of the wall's grain on the same rms: the rendered line, times the grain that the
                   recording shows a few pixels further out, less the rendered line. The truth holds
                   reflectance at 0.24 mm a sample; finer grain is in the recording alone
exact, rms         recorded less the exact line, to show what rendering explains
PSNR               of lit frames after one gain, with LEDs by the default law, and with the law (even share,
                   exponent 1.5) fitted to one frame of the recording, which does not state its own
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace

import cv2
import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Float, Image, Int
from pipeline.recording import open_recording
from pipeline.simulator.render import renderer_of
from pipeline.simulator.scene import LightScene
from pipeline.simulator.truth import SceneTruth
from tests.exact_rings import exact_rings
from tests.resimulation import fitted_probe, truth_of_recording, with_probe
from tests.resimulation_compare import lights_of, line_radii, matched, psnr_db
from tests.shared_data import shared

_FIT_FRAMES, _FRAMES, _LIT_FRAMES = 8, 8, 3
_AZIMUTHS, _BIN = 720, 10
_OUTLIER_PX, _GRAIN_SHIFT_PX, _GRAIN_SIGMA_PX = 1.5, 24, 4.0
_AZIMUTH = -np.pi + 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS


@dataclass(frozen=True)
class Difference:
    """Of means over 5 degrees, px: mean, rms, median, robust 1 σ, and the rms that all frames share."""

    mean: float
    rms: float
    median: float
    typical: float
    steady: float


@dataclass(frozen=True)
class Rings:
    """The line of some frames (F, A), px: recorded, rendered, rendered with grain, and exact."""

    recorded: Float
    rendered: Float
    grained: Float
    exact: Float


def compared(truth: SceneTruth, pictures: dict[int, Image], frames: list[int]) -> Rings:
    """Measure the line in frames, recorded and rendered, in the same way."""
    centre = truth.stated.camera.centre_px
    exact = exact_rings(truth, frames, _AZIMUTH, centre)
    radii: list[list[Float]] = [[], [], []]
    for n, near in zip(frames, exact, strict=True):
        rendered = matched(pictures[n], lights_of(truth, n))
        grain = np.roll(_grain(pictures.get(n + 1, pictures[n])), _GRAIN_SHIFT_PX, axis=(0, 1))
        grained = np.clip(rendered * grain[..., None] + 0.5, 0, 255).astype(np.uint8)
        for kept, image in zip(radii, (pictures[n], rendered, grained), strict=True):
            kept.append(line_radii(image, near, _AZIMUTH, centre))
    return Rings(*(np.stack(kept) for kept in radii), exact)


def _grain(picture: Image) -> Float:
    """Return a lit picture's fine contrast (H, W): green over its blurred copy; 1 where it is dark."""
    green = picture[..., 1].astype(np.float32)
    smooth = cv2.GaussianBlur(green, (0, 0), _GRAIN_SIGMA_PX)
    return np.where(smooth > 15, np.clip(green / np.maximum(smooth, 1.0), 0.3, 2.0), 1.0)


def difference(one: Float, other: Float) -> Difference:
    """Return how lines (F, A) differ."""
    off = one - other
    off = np.where(np.abs(off - np.nanmedian(off)) < _OUTLIER_PX, off, np.nan)
    full = off.reshape(len(off), -1, _BIN)
    binned = np.where(
        np.isfinite(full).sum(2) > _BIN // 2, np.nansum(full, 2) / np.isfinite(full).sum(2), np.nan
    )
    median = float(np.nanmedian(binned))
    typical = robust_spread(binned - median)
    steady = float(np.nanstd(np.nanmean(binned, axis=0)))
    return Difference(float(np.nanmean(binned)), float(np.nanstd(binned)), median, typical, steady)


def true_probe_put(truth: SceneTruth, pictures: dict[int, Image], frames: list[int]) -> SceneTruth:
    """Return the scene with the instrument, within its stated σ, that best predicts the recorded lines."""
    centre = truth.stated.camera.centre_px
    near = exact_rings(truth, frames, _AZIMUTH, centre)
    seen = np.stack([line_radii(pictures[n], r, _AZIMUTH, centre) for n, r in zip(frames, near, strict=True)])
    middle = _AZIMUTH.reshape(-1, _BIN).mean(1)
    binned = np.nanmedian((seen - near).reshape(len(frames), -1, _BIN), axis=2)
    radius = exact_rings(truth, frames, middle, centre) + binned
    return with_probe(truth, fitted_probe(truth, frames, middle, centre, radius))


def lit_psnr(truth: SceneTruth, pictures: dict[int, Image], frames: list[int]) -> tuple[float, float]:
    """Return the mean PSNR of lit frames, dB, with the default law of the LEDs and with the recording's."""
    default = LightScene.model_validate({})
    told = [with_leds(truth, 1.5, even) for even in (0.0, 1.0)]
    plain = with_leds(truth, default.lobe, default.even)
    lobe, even = (_lit(scene, frames[0]) for scene in told)
    seen = pictures[frames[0]].astype(float)
    weight = np.linalg.lstsq(np.stack([lobe.ravel(), even.ravel()], 1), seen.ravel(), rcond=None)[0]
    rows = []
    for n in frames[1:]:
        mixed = weight[0] * _lit(told[0], n) + weight[1] * _lit(told[1], n)
        rows.append([psnr_db(pictures[n], _gained(light, pictures[n])) for light in (_lit(plain, n), mixed)])
    by_default, by_own = np.mean(rows, axis=0)
    return float(by_default), float(by_own)


def with_leds(truth: SceneTruth, lobe: float, even: float) -> SceneTruth:
    light = replace(truth.instrument.light, lobe=lobe, even=even)
    return replace(truth, instrument=replace(truth.instrument, light=light))


def _lit(truth: SceneTruth, frame: int) -> Float:
    return renderer_of(truth).seen(frame).astype(float)


def _gained(light: Float, recorded: Image) -> Image:
    gain = float((light * recorded).sum() / (light * light).sum())
    return np.clip(gain * light + 0.5, 0, 255).astype(np.uint8)


def spread(numbers: Int, many: int) -> list[int]:
    """Return so many of some numbers, evenly spread and away from the ends."""
    return [int(numbers[int(k)]) for k in np.linspace(0.06, 0.94, many) * (len(numbers) - 1)]


def study(name: str) -> None:
    folder = shared("recordings", name)
    truth = truth_of_recording(folder)
    kinds = truth.frames.illumination
    lines = np.flatnonzero(kinds != "led")
    fit, frames = spread(lines, _FIT_FRAMES), spread(lines[1:], _FRAMES)
    lit = spread(np.flatnonzero(kinds == "led"), _LIT_FRAMES) if (kinds == "led").any() else []
    wanted = sorted({*fit, *frames, *lit, *(n + 1 for n in frames if kinds[n + 1] == "led")})
    pictures = {n: p.copy() for n, p in open_recording(folder).read(wanted, "bgr") if p is not None}
    fitted = true_probe_put(truth, pictures, fit)
    rings = compared(fitted, pictures, frames)
    seen = difference(rings.recorded, rings.rendered)
    grain = difference(rings.grained, rings.rendered)
    exact = difference(rings.recorded, rings.exact)
    psnr = "     -      -" if not lit else "{:6.1f} {:6.1f}".format(*lit_psnr(fitted, pictures, lit))
    line = f"{seen.mean:+7.4f} {seen.rms:7.4f} {seen.median:+7.4f} {seen.typical:7.4f} {seen.steady:7.4f}"
    beside = (
        f"{grain.rms:7.4f} {grain.typical:7.4f}  {exact.mean:+7.4f} {exact.rms:7.4f} {exact.typical:7.4f}"
    )
    print(f"{name:14} {line}  {beside}  {psnr}", flush=True)


if __name__ == "__main__":
    print("                                                         by grain:        recorded - exact:")
    print("px           bias    rms   median typical steady    rms   typical    bias   rms    typical   PSNR")
    for recording in sys.argv[1:] or ("open-1-field", "open-1-gauge", "open-3-field"):
        study(recording)
