"""Compare recorded frames with their twins: the same frames, re-rendered from what a run has measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field
from threadpoolctl import threadpool_limits

from pipeline.arrays import Bool, Int
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.twin import Mismatch, Twin
from pipeline.artefacts.wall_map import FixedToProbe
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checks import CheckedFrames
from stages.twin.blocks import blocks_of
from stages.twin.cannot_tell import cannot_tell
from stages.twin.compare import Comparison
from stages.twin.findings import Compared
from stages.twin.fixed_pattern import pattern_figures
from stages.twin.lamp_power import lamp_power
from stages.twin.locate import (
    LEAST_CONTRAST,
    ImagePlace,
    beside,
    full_size,
    places_displaced,
    places_in_image,
)
from stages.twin.name import left_over, noise_figures, state_figures
from stages.twin.photo_course import hidden_failures
from stages.twin.pixels import defective_pixels
from stages.twin.render import Region
from stages.twin.scene import Scene, scene_of
from stages.twin.state import (
    PhotometricState,
    black_of_photo,
    clipped_line,
    clipped_pixels,
    estimate_state,
    sample_frames,
)
from stages.twin.sums import MOST_STRAY, Sums
from stages.twin.worst import maps_of, worst_places

_EVERY, _COLOURED, _CLIPPED_FRAMES = 10, 3, 8
"""Frames from one compared frame to the next where none is withheld. Laser frames whose colours give that of
the line and its clipping: decoding colour takes three times as long. Least number of them that show what
leaks."""
_ROUNDS = 3
"""Rounds in which the displacement of texture is measured, each in frames drawn with the one before: the
second finds a third of the first, the fourth hardly any."""


class PhotometryParameters(Parameters):
    """Parameters of the estimate of the photometric state."""

    sampled: int = Field(
        12,
        ge=3,
        le=200,
        description="measured frames of each light from which lamps, laser and noise are estimated",
    )
    blur_px: float = Field(0.9, ge=0.3, le=5.0, description="1 σ of the blur by lens and pixel in the photo")


class TwinParameters(Parameters):
    """Parameters of the twin."""

    compared: int = Field(
        60, ge=2, le=1000, description="most frames that are re-rendered, spread over the recording"
    )


@dataclass(frozen=True)
class Photometry:
    """The photometric state of a run, and places where all frames differ from their twins.

    Attributes
    ----------
    state : PhotometricState
        Its ``gain_map`` holds the transmission of dirt on the window, where some was found.
    places : tuple of ImagePlace
        Where texture is displaced, then where the image is darker or brighter.
    blurred : tuple of ImagePlace
        Other places, where texture is fainter or stronger.
    blur_px : float
        1 σ of the blur by lens and pixel that was assumed, px.
    pixels : tuple of Mismatch
        Defective pixels of the sensor.
    """

    state: PhotometricState
    places: tuple[ImagePlace, ...]
    blurred: tuple[ImagePlace, ...]
    blur_px: float
    pixels: tuple[Mismatch, ...] = ()


def measure_photometry(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    rings: RingSamples,
    trajectory: Trajectory,
    wall: Wall,
    texture: WallTexture,
    parameters: PhotometryParameters,
    context: Context,
) -> Photometry:
    """Estimate camera noise, lamps, laser line, blur and dirt from frames that the run has measured."""
    with threadpool_limits(1, "blas"):  # more BLAS threads wait for each other longer than they work
        scene = scene_of(probe, trajectory, wall, texture, parameters.blur_px)
        return photometry_of(scene, recording, frames, rings, parameters, context)


def photometry_of(
    scene: Scene, recording: Recording, frames: CheckedFrames, rings: RingSamples,
    parameters: PhotometryParameters, context: Context,
) -> Photometry:  # fmt: skip
    """Return the photometric state of a scene; see `measure_photometry`."""
    _, measured = _split(frames, scene.trajectory, 0)
    sampled = sample_frames(
        recording, frames.frame[measured], frames.illumination[measured], parameters.sampled
    )
    lines = [s.frame for s in sampled if s.light == Illumination.LASER]
    colour = list(recording.read(np.array(lines[:: max(len(lines) // _COLOURED, 1)], np.int64), "bgr"))
    state = estimate_state(scene, sampled, colour, rings, context)
    state = replace(state, line_clipped=clipped_line(scene, colour), photo_black=black_of_photo(colour))
    defects = defective_pixels(
        [s.image.astype(np.uint8) for s in sampled],
        [s.light in state.shows_wall for s in sampled],
        ~(state.outside | state.edge),
    )
    for k, one in enumerate(sampled):
        sampled[k] = replace(one, image=defects.mended(one.image))
    displaced: tuple[ImagePlace, ...] = ()
    for _ in range(_ROUNDS):
        ratios, textures = blocks_of(scene, state, sampled)
        found, aside = places_displaced([place for _, place in textures])
        if aside is None:
            break
        displaced = displaced or found
        whole = np.stack([full_size(a, state.outside.shape, 0.0) for a in aside])
        state = replace(state, aside=whole if state.aside is None else state.aside + whole)
    places, gain = places_in_image(ratios)
    blurred, _ = places_in_image([contrast for contrast, _ in textures], LEAST_CONTRAST)
    # A drop that displaces texture leaves bright and dark fragments of it, which are no separate places.
    places = (*displaced, *beside(places, displaced))
    if gain is not None:
        state = replace(state, gain_map=full_size(gain, state.outside.shape))
    return Photometry(state, places, beside(blurred, places), parameters.blur_px, defects.mismatches())


def compare_with_twin(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    rings: RingSamples,
    trajectory: Trajectory,
    wall: Wall,
    texture: WallTexture,
    photometry: Photometry,
    parameters: TwinParameters,
    context: Context,
) -> Twin:
    """Re-render frames, compare them with the recorded ones, and report where they differ and for what cause.

    Raises
    ------
    UnusableError
        When no frame could be decoded.
    """
    with threadpool_limits(1, "blas"):
        scene = scene_of(probe, trajectory, wall, texture, photometry.blur_px)
        return compared_with(scene, recording, frames, rings, photometry, parameters, context, wall.fixed)


def compared_with(
    scene: Scene, recording: Recording, frames: CheckedFrames, rings: RingSamples, photometry: Photometry,
    parameters: TwinParameters, context: Context, fixed: FixedToProbe | None = None,
) -> Twin:  # fmt: skip
    """Compare frames of a scene with their twins; ``fixed`` is what stays at one place of the line.

    See `compare_with_twin`.
    """
    if frames.withheld is None:
        context.warn(_NONE_WITHHELD)
    chosen, _ = _split(frames, scene.trajectory, parameters.compared)
    light = dict(zip(frames.frame.tolist(), map(Illumination, frames.illumination.tolist()), strict=True))
    light = {n: light[n] for n in chosen.tolist()}
    state, sums = photometry.state, _summed(scene, recording, light, photometry, context)
    samples, lit = sums.blocks.samples(), [n for n, kind in light.items() if kind in state.shows_wall]
    compared = Compared(scene, state, recording, rings, lit, sums, samples, photometry.pixels, fixed)
    return _twin(compared, frames.withheld is not None, context)


def _summed(
    scene: Scene, recording: Recording, light: dict[int, Illumination], photometry: Photometry,
    context: Context,
) -> Sums:  # fmt: skip
    """Return the sums over frames, of which ``light`` gives the light by frame number."""
    laser = np.array([n for n, kind in light.items() if kind == Illumination.LASER], np.int64)
    step = max(len(laser) // _CLIPPED_FRAMES, 1) if photometry.state.line_clipped else len(laser) + 1
    clips = clipped_pixels(recording.read(laser[step - 1 :: step], "bgr"))
    places = (*photometry.places, *photometry.blurred)
    sums = Sums(scene, photometry.state, places, clips, _spread(laser, MOST_STRAY).tolist())
    for done, (frame, image) in enumerate(recording.read(np.array([*light], np.int64), "grey")):
        context.progress(done, len(light))
        if image is not None:
            sums.add(frame, light[frame], image)
    if not sums.comparison.views:
        raise UnusableError("twin", "no frame could be decoded", hint="copy the video again")
    return sums


def _twin(compared: Compared, withheld: bool, context: Context) -> Twin:
    """Return what is found in compared frames, and the figures about them."""
    state, samples, comparison = compared.state, compared.samples, compared.sums.comparison
    found, withdrawn = compared.findings()
    fall, unnamed_map = left_over(None if samples is None else samples.seen_through(state.gain_map))
    comparison.after[Region.WALL] -= fall
    _report(comparison, found, context)
    power = () if comparison.wall_is_clipped else lamp_power(samples)
    return Twin(
        np.array([v.frame for v in comparison.views]), withheld,
        (*noise_figures(state.noise), *pattern_figures(state.pattern)),
        (*state_figures(state), *power, *unnamed_map),
        comparison.regions(), found, comparison.psnr_db(False), comparison.psnr_db(True),
        comparison.chi2_camera, comparison.stray_share,
        comparison.seen / max(comparison.view, 1.0), comparison.compared_share,
        (*cannot_tell(state, comparison.silent), *hidden_failures(samples, compared.scene.ring)),
        tuple(comparison.views), maps_of(samples), comparison.levels(), worst_places(samples), withdrawn,
    )  # fmt: skip


_NONE_WITHHELD = (
    "no frame was withheld from the run: the compared frames are among those that wall, motion and photo "
    "were made from, so that errors absorbed in the fit do not show. What to do: run the recording with "
    "--set premises.withhold=10"
)


def _split(frames: CheckedFrames, trajectory: Trajectory, most: int) -> tuple[Int, Bool]:
    """Return up to ``most`` frames to compare, and a mask (N,) of all frames that the run has measured."""
    posed = np.isin(frames.frame, trajectory.frame)
    if frames.withheld is None:
        chosen = np.zeros(len(frames.frame), bool)
        chosen[_EVERY // 2 :: _EVERY - 1] = True
        measured = posed
    else:
        chosen, measured = frames.withheld, posed & ~frames.withheld
    return _spread(frames.frame[chosen & posed], most), measured


def _spread(frame: Int, most: int) -> Int:
    """Return up to ``most`` of some frames (F,), spread evenly over them."""
    few = np.linspace(0, len(frame) - 1, min(most, len(frame))).round().astype(int)
    return np.asarray(frame[np.unique(few)])


def _report(comparison: Comparison, found: tuple[Mismatch, ...], context: Context) -> None:
    for region in comparison.regions():
        context.report(f"chi-square per pixel, {region.name}", region.chi2_after, "")
    context.report("peak signal to noise, lit wall", comparison.psnr_db(False), "dB")
    context.report("the same without the noise", comparison.psnr_db(True), "dB")
    context.report("mismatches found", len(found), "")


PHOTOMETRY = Stage(
    "photometry",
    "33",
    PhotometryParameters,
    measure_photometry,
    "camera noise, lamps, laser line, blur and dirt on the window, from the frames of a run",
)
TWIN = Stage(
    "twin",
    "90",
    TwinParameters,
    compare_with_twin,
    "recorded frames beside the same frames, re-rendered from what the run has measured",
)
