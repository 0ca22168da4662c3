"""From light to grey levels: window, glare, blur, bloom, noise, clipping, gamma, rounding."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from scipy.special import ndtri

from pipeline.arrays import Float32, Image
from pipeline.simulator.instrument import Dust, TrueSensor
from pipeline.simulator.kernel import in_bands, kernel
from pipeline.simulator.view import hashed

# Glare spreads over tens of px: a picture 8 times smaller represents it.
_VEIL_SHRINK = 8
# Blurs between which a blur that varies over the picture is mixed: the variance is exact, the shape nearly.
_BLURS = 5
# Number of the random stream of the pixels' dark signals and defects.
_PIXEL_STREAM = 3
# Normal quantiles that noise is drawn from: 16 random bits each; the largest is 4.3 σ.
_QUANTILES = 1 << 16


def through_lens(light: Float32, sensor: TrueSensor, shade: Float32 | None) -> Float32:
    """Return light (H, W, 3) after vignetting and dust, glare and blur; ``shade`` (H, W) or None."""
    seen: Float32 = light
    for drop in sensor.drops:
        seen = _through_drop(seen, drop)
    if shade is not None:
        seen = seen * shade[..., None]
    for spot in sensor.scatter:
        share = spot.attenuation * _spot(spot, seen.shape[:2])[..., None]
        seen = (1 - share) * seen + share * _widely(seen, sensor.veil_sigma_px)
    if sensor.veil_relative > 0:
        seen = (1 - sensor.veil_relative) * seen + sensor.veil_relative * _widely(seen, sensor.veil_sigma_px)
    seen = _blurred(seen, sensor)
    return (
        _bloomed(np.asarray(seen, np.float32), sensor)
        if sensor.bloom_relative > 0
        else np.asarray(seen, np.float32)
    )


def _blurred(light: Float32, sensor: TrueSensor) -> Float32:
    """Return light through a lens whose blur may grow towards the picture's edge.

    Between blurs of fixed size the pictures are mixed by their share of the variance, so that the variance
    of the mixture is exactly the one asked for.
    """
    if sensor.psf_edge_px == 0:
        return _gaussian(light, sensor.psf_sigma_px)
    height, width = light.shape[:2]
    v, u = np.mgrid[:height, :width].astype(np.float32)
    middle = (width - 1) / 2, (height - 1) / 2
    away = ((u - middle[0]) ** 2 + (v - middle[1]) ** 2) / (min(width, height) / 2) ** 2
    wanted = sensor.psf_sigma_px**2 + sensor.psf_edge_px**2 * away**2
    nodes = np.linspace(np.sqrt(wanted.min()), np.sqrt(wanted.max()), _BLURS) ** 2
    out = np.zeros_like(light)
    for k, variance in enumerate(nodes):
        hat = np.interp(wanted, nodes, np.eye(_BLURS)[k]).astype(np.float32)
        out += hat[..., None] * _gaussian(light, float(np.sqrt(variance)))
    return out


def _gaussian(light: Float32, sigma_px: float) -> Float32:
    if sigma_px <= 0:
        return light
    # at 6 σ the cut-off tail is below rounding
    side = 2 * int(np.ceil(6 * sigma_px)) + 1
    blurred = cv2.GaussianBlur(light, (side, side), sigma_px, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, np.float32)


def _bloomed(light: Float32, sensor: TrueSensor) -> Float32:
    """Return light with a share of the part above full scale spread along the columns; the sum is kept."""
    leaked = sensor.bloom_relative * np.maximum(light - 1, 0)
    reach = int(np.ceil(8 * sensor.bloom_px))
    spread = np.exp(-np.abs(np.arange(-reach, reach + 1)) / sensor.bloom_px)
    along = cv2.sepFilter2D(leaked, -1, np.ones(1), spread / spread.sum(), borderType=cv2.BORDER_CONSTANT)
    return np.asarray(light - leaked + along, np.float32)


def _through_drop(light: Float32, drop: Dust) -> Float32:
    """Return light refracted by a drop: a pixel at Δ from its middle sees Δ (1 − power (1 − Δ²/R²))."""
    v, u = np.mgrid[: light.shape[0], : light.shape[1]].astype(np.float32)
    du, dv = u - np.float32(drop.centre_px[0]), v - np.float32(drop.centre_px[1])
    inside = np.clip(1 - (du / drop.sigma_px[0]) ** 2 - (dv / drop.sigma_px[1]) ** 2, 0, None)
    bent = np.float32(drop.attenuation) * inside.astype(np.float32)
    return np.asarray(cv2.remap(light, u - bent * du, v - bent * dv, cv2.INTER_LINEAR), np.float32)


def _spot(spot: Dust, shape: tuple[int, ...]) -> Float32:
    """Return a spot's weight (H, W), 1 in its middle."""
    v, u = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    (cu, cv), (su, sv) = spot.centre_px, spot.sigma_px
    return np.asarray(np.exp(-0.5 * (((u - cu) / su) ** 2 + ((v - cv) / sv) ** 2)), np.float32)


def with_dark_signal(light: Float32, sensor: TrueSensor, seed: int) -> Float32:
    """Return light (H, W, 3) with the pixels' dark signals and defects, the same in all frames of a seed."""
    if sensor.dark_pattern == 0 and sensor.defective_share == 0:
        return light
    random = np.random.default_rng([seed, _PIXEL_STREAM])
    shape = light.shape[:2]
    dark = sensor.dark_pattern * random.standard_normal(shape)
    drawn = random.random(shape)
    dark += sensor.hot_level * (drawn < sensor.defective_share)
    alive = drawn < 1 - sensor.defective_share
    return np.asarray(alive[..., None] * (light + dark[..., None]), np.float32)


def shade_of(sensor: TrueSensor, cosine: Float32) -> Float32 | None:
    """Return the share of light (H, W) that vignetting and dust leave, given cos θ.

    None where they leave all.
    """
    if sensor.vignetting == 0 and not sensor.dust:
        return None
    shade = np.clip(cosine, 0, 1) ** sensor.vignetting if sensor.vignetting else np.ones_like(cosine)
    for spot in sensor.dust:
        shade = shade * (1 - spot.attenuation * _spot(spot, shade.shape))
    return np.asarray(shade, np.float32)


def exposed(light: Float32, sensor: TrueSensor, seed: int, frame: int) -> Image:
    """Return grey levels (H, W, 3) of light in full scales; noise depends on seed, frame and pixel alone."""
    out = np.empty(light.shape, np.uint8)
    well, read, black = sensor.full_well_e, sensor.read_noise_e, sensor.black_level
    draw = np.uint64(seed * 1_000_003 + frame + 1)
    numbers = (well, read, black, sensor.gamma, sensor.fixed_pattern)
    quantile = _normal_quantiles()
    dark = _grey(quantile * read / well, black, sensor.gamma)

    def band(first: int, last: int) -> None:
        _expose(light, numbers, draw, np.uint64(seed), quantile, dark, first, last, out)

    in_bands(band, len(light))
    return out


def _grey(share: Float32, black: float, gamma: float) -> Image:
    return np.asarray(black + (255 - black) * np.clip(share, 0, 1) ** gamma + 0.5, np.uint8)


def _widely(light: Float32, sigma_px: float) -> Float32:
    """Return light with a wide blur, computed on a smaller picture."""
    size = light.shape[1] // _VEIL_SHRINK, light.shape[0] // _VEIL_SHRINK
    small = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma_px / _VEIL_SHRINK)
    return np.asarray(cv2.resize(small, light.shape[1::-1], interpolation=cv2.INTER_LINEAR), np.float32)


@cache
def _normal_quantiles() -> Float32:
    return np.asarray(ndtri((np.arange(_QUANTILES) + 0.5) / _QUANTILES), np.float32)


@kernel
def _expose(
    light: Float32, numbers: tuple[float, float, float, float, float], draw: np.uint64, seed: np.uint64,
    quantile: Float32, dark: Image, v_from: int, v_to: int, out: Image,
) -> None:  # fmt: skip
    well, read, black, gamma, pattern = numbers
    columns, mask = light.shape[1], np.uint64(0xFFFF)
    for v in range(v_from, v_to):
        for u in range(columns):
            pixel = np.uint64(v * columns + u + 1)
            bits = hashed(draw * np.uint64(0x9E3779B97F4A7C15) + pixel * np.uint64(0xD1B54A32D192ED03))
            if light[v, u, 0] == 0.0 and light[v, u, 1] == 0.0 and light[v, u, 2] == 0.0:
                for c in range(3):
                    out[v, u, c] = dark[(bits >> np.uint64(16 * c)) & mask]
                continue
            gain = 1.0
            if pattern > 0.0:
                fixed = hashed(seed + pixel * np.uint64(0xA24BAED4963EE407))
                gain += pattern * quantile[fixed & mask]
            for c in range(3):
                mean = light[v, u, c] * gain * well
                drawn = quantile[(bits >> np.uint64(16 * c)) & mask]
                electrons = mean + np.sqrt(max(mean, 0.0) + read * read) * drawn
                share = min(max(electrons / well, 0.0), 1.0)
                if gamma != 1.0:
                    share = share**gamma
                out[v, u, c] = np.uint8(black + (255.0 - black) * share + 0.5)
