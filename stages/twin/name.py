"""Names of what differs between recorded and re-rendered frames, kept only if frames then fit better."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from pipeline.arrays import Float, Float32, Int
from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.artefacts.twin import Mismatch, NamedFigure
from pipeline.recording.base import Illumination
from stages.twin.locate import FALSE_ALARM, ImagePlace
from stages.twin.noise import CameraNoise
from stages.twin.render import Region, TwinFrame
from stages.twin.state import PhotometricState

_LEAST_FLICKER = 0.01
"""Exposures that vary by less count as even: the photo's own error of brightness is of that order."""
_DIM_SECTOR = 0.5
"""A sector of the laser is dim below this share of the usual power; the wall's reflectance changes less."""
_CLIPPED = 0.05
_NOT_TOLD = (
    "as far as frames show it; whether the image or the wall is so cannot be told. What to do: record once "
    "more with the probe rolled"
)


@dataclass
class Exposures:
    """Exposures of the compared lit frames, relative to those of the sampled frames about them."""

    log_ratio: list[float] = field(default_factory=list)
    frames: list[int] = field(default_factory=list)
    before: float = 0.0
    after: float = 0.0
    pixels: float = 0.0

    def add(self, frame: int, light: Illumination, log_ratio: float, above: Float32, twin: TwinFrame) -> None:
        """Count a lit frame with grey levels ``above`` black; frames of the line alone are left out.

        Speckle and fine reflectance let the brightness of a line vary more than any lamp does.
        """
        if light == Illumination.LASER:
            return
        wall = twin.region == Region.WALL
        level, variance = twin.level[wall], twin.variance[wall]
        self.before += float(((above[wall] - level) ** 2 / variance).sum(dtype=float))
        ratio = np.float32(np.exp(log_ratio))
        self.after += float(((above[wall] - ratio * level) ** 2 / variance).sum(dtype=float))
        self.pixels += float(wall.sum())
        self.frames.append(frame)
        self.log_ratio.append(log_ratio)


def flicker(exposures: Exposures, state: PhotometricState) -> tuple[Mismatch, ...]:
    """Return flicker where exposures vary between frames by more than chance and the light's own error."""
    if state.lamp is None or len(exposures.log_ratio) < 3 or exposures.after >= exposures.before:
        return ()
    steps = np.concatenate([exposures.log_ratio, state.lamp.gain.log_value])
    spread, sd = float(np.std(steps)), float(np.median(state.lamp.gain.sd))
    chance = float(chi2.sf(len(steps) * spread**2 / (sd**2 + _LEAST_FLICKER**2), len(steps) - 1))
    if chance > FALSE_ALARM or spread < _LEAST_FLICKER:
        return ()
    place = (
        NamedFigure("frame_from", min(exposures.frames), 0.0),
        NamedFigure("frame_to", max(exposures.frames), 0.0),
    )
    size = NamedFigure("exposure", spread, spread / np.sqrt(2 * len(steps)), "relative")
    return (
        Mismatch(
            "flicker", "intensity", "time", place, (size,), chance,
            exposures.before / exposures.pixels, exposures.after / exposures.pixels,
            f"The exposure of lit frames varies by {100 * spread:.1f} % (1 σ) from frame to frame.",
        ),
    )  # fmt: skip


@dataclass
class Dirt:
    """Places of the image that are darker or brighter, and how frames fit there without and with them."""

    places: tuple[ImagePlace, ...]
    index: tuple[Int, ...]
    before: Float
    after: Float
    pixels: Float

    def add(self, above: Float32, before: TwinFrame, after: TwinFrame) -> None:
        """Count a compared frame."""
        for k, flat in enumerate(self.index):
            use = flat[before.region.ravel()[flat] == Region.WALL]
            for total, twin in ((self.before, before), (self.after, after)):
                rest = above.ravel()[use] - twin.level.ravel()[use]
                total[k] += float((rest**2 / twin.variance.ravel()[use]).sum(dtype=float))
            self.pixels[k] += len(use)

    def accepted(self, fixed_to: tuple[str, ...]) -> tuple[Mismatch, ...]:
        """Return the places with which compared frames fit better and that stay in the image in all of them.

        The others are withdrawn. ``fixed_to`` says of each place what it is fixed to.
        """
        return tuple(
            _dirt(p, self.before[k] / self.pixels[k], self.after[k] / self.pixels[k], fixed_to[k])
            for k, p in enumerate(self.places)
            if self.pixels[k] and self.after[k] < self.before[k] and "image" in fixed_to[k]
        )


def dirt(places: tuple[ImagePlace, ...], shape: tuple[int, ...]) -> Dirt:
    """Return an empty count of places in an image (H, W)."""
    v, u = np.mgrid[0 : shape[0], 0 : shape[1]]
    index = tuple(np.flatnonzero((u - p.u_px) ** 2 + (v - p.v_px) ** 2 < p.radius_px**2) for p in places)
    before, after, pixels = np.zeros((3, len(places)))
    return Dirt(places, index, before, after, pixels)


def _dirt(place: ImagePlace, before: float, after: float, fixed_to: str) -> Mismatch:
    sure, way = fixed_to == "image", "darker" if place.change < 0 else "brighter"
    where = tuple(
        NamedFigure(name, value, place.radius_px / 2, "px")
        for name, value in (("u_px", place.u_px), ("v_px", place.v_px), ("radius_px", place.radius_px))
    )
    return Mismatch(
        "window_dirt" if sure and place.change < 0 else "", "intensity", fixed_to, where,
        (NamedFigure("change", place.change, place.sd, "relative"),), place.probability, before, after,
        f"About ({place.u_px:.0f}, {place.v_px:.0f}) the image is {100 * abs(place.change):.0f} % {way} "
        + ("in all frames: dust, a droplet or dirt on the window or the lens." if sure else _NOT_TOLD),
    )  # fmt: skip


def of_line(state: PhotometricState, rings: RingSamples) -> tuple[Mismatch, ...]:
    """Return dim sectors of the laser and a clipped line. Neither is re-rendered: both leave χ² as it was."""
    found = []
    nan = float("nan")
    if state.line is not None:
        relative = np.exp(state.line.log_power - np.median(state.line.log_power))
        sector = 360 / len(relative)
        for k in np.flatnonzero((relative < _DIM_SECTOR) & (state.line.power_sd > 0)):
            azimuth = -180 + (k + 0.5) * sector
            power = float(relative[k])
            size = NamedFigure("power", power, power * float(state.line.power_sd[k]), "relative")
            found.append(Mismatch(
                "laser_sector_dim", "line", "line",
                (NamedFigure("image_azimuth", azimuth, sector / 2, "deg"),), (size,), 0.0, nan, nan,
                f"At image azimuth {azimuth:.0f}° the line has {100 * power:.0f} % of its usual brightness.",
            ))  # fmt: skip
    clipped = float(np.mean(rings.validity == RingValidity.SATURATED)) if rings.validity.size else 0.0
    if clipped > _CLIPPED:
        share = NamedFigure("share", clipped, 0.0, "of ring samples")
        found.append(Mismatch(
            "saturation", "line", "line", (), (share,), 0.0, nan, nan,
            f"The line is clipped in {100 * clipped:.0f} % of the ring samples.",
        ))  # fmt: skip
    return tuple(found)


def noise_figures(noise: CameraNoise) -> tuple[NamedFigure, ...]:
    """Return the camera's noise as EMVA 1288 has it."""
    e, read = noise.electrons_per_level, noise.read_electrons
    return (
        NamedFigure("black_dn", noise.black.value, noise.black.sd, "grey levels"),
        NamedFigure("white_dn", noise.white, 0.0, "grey levels"),
        NamedFigure("read_e", read.value, read.sd, "electrons"),
        NamedFigure("gain_e_per_dn", e.value, e.sd, "electrons per grey level"),
        NamedFigure("non_uniformity", noise.uneven.value, noise.uneven.sd, "relative"),
        NamedFigure("gamma", noise.gamma.value, noise.gamma.sd, ""),
    )


def state_figures(state: PhotometricState) -> tuple[NamedFigure, ...]:
    """Return what lamps, laser and lens do, in few numbers."""
    found: list[NamedFigure] = []
    if state.lamp is not None:
        found.append(
            NamedFigure(
                "photo_place_px", float(np.median(state.place_px)), float(np.ptp(state.place_px)) / 2, "px"
            )
        )
        found.append(
            NamedFigure(
                "exposure_spread", state.lamp.gain.spread, float(np.median(state.lamp.gain.sd)), "relative"
            )
        )
        names = ("lamp_cos_1", "lamp_sin_1", "lamp_cos_2", "lamp_sin_2")
        found += [
            NamedFigure(n, float(v), float(s), "relative")
            for n, v, s in zip(names, state.lamp.pattern, state.lamp.pattern_sd, strict=True)
        ]
    if state.line is not None:
        line = state.line
        found += [
            NamedFigure(
                "laser_power_spread", line.course.spread, float(np.median(line.course.sd)), "relative"
            ),
            NamedFigure("sheet_sigma_mm", line.sheet_mm.value, line.sheet_mm.sd, "mm"),
            NamedFigure("lens_blur_px", line.blur_px.value, line.blur_px.sd, "px"),
            NamedFigure("line_halo", line.halo.value, line.halo.sd, "share of light"),
            NamedFigure("line_skewness", line.skewness.value, line.skewness.sd, ""),
            NamedFigure("speckle", line.speckle.value, line.speckle.sd, "relative"),
        ]
    return tuple(found)


def cannot_tell(state: PhotometricState) -> tuple[str, ...]:
    """Return what such recordings do not tell, as sentences."""
    said = [
        "Vignetting cannot be told from the LEDs' lobe: both change brightness with the polar angle alone.",
        "A power response cannot be told from the wall's contrast; gamma is read off the noise, which a "
        "video codec changes: it is no proof of a response that is not linear.",
    ]
    if state.lamp is None:
        said.append("No lit frame could be used: nothing is known of lamps, vignetting and photon transfer.")
    if state.line is None:
        said.append("No frame of the laser alone could be used: nothing is known of the line's profile.")
    else:
        said.append(
            "The sheet's thickness is the stated one: in one diameter it cannot be told from the lens' blur."
        )
    return tuple(said)
