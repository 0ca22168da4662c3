"""Twin: recorded frames beside the same frames, re-rendered from what a run has measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from pipeline.arrays import Bool, Float32, Int
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.twin import Mismatch, Twin
from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Parameters, Stage
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checked_frames import CheckedFrames
from stages.twin.compare import Comparison, block_ratios, exposure_of
from stages.twin.locate import ImagePlace, full_size, places_in_image
from stages.twin.name import Exposures, cannot_tell, dirt, flicker, noise_figures, of_line, state_figures
from stages.twin.reference import BlocksOfFrames, in_image, maps_of, unnamed
from stages.twin.render import render_frame
from stages.twin.scene import Scene, scene_of
from stages.twin.state import PhotometricState, Sampled, estimate_state, sample_frames

_EVERY = 10


class PhotometryParameters(Parameters):
    """Parameters of the photometric state."""

    sampled: int = Field(
        12,
        ge=3,
        le=200,
        description="measured frames of each light that lamps, laser and noise are taken from",
    )
    blur_px: float = Field(
        0.9, ge=0.3, le=5.0, description="1 σ of lens and pixel that the photo is seen with"
    )


class TwinParameters(Parameters):
    """Parameters of the twin."""

    compared: int = Field(
        60, ge=2, le=1000, description="most frames that are re-rendered, spread over the recording"
    )


@dataclass(frozen=True)
class Photometry:
    """The photometric state of a run, and where the image is darker or brighter in all frames.

    Attributes
    ----------
    state : PhotometricState
        Its ``gain_map`` holds what dirt lets through, where some was found.
    places : tuple of ImagePlace
    blur_px : float
        1 σ of lens and pixel that it holds for.
    """

    state: PhotometricState
    places: tuple[ImagePlace, ...]
    blur_px: float


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
    _, measured = _split(frames, trajectory, 0)
    scene = scene_of(probe, trajectory, wall, texture, parameters.blur_px)
    sampled = sample_frames(
        recording, frames.frame[measured], frames.illumination[measured], parameters.sampled
    )
    state = estimate_state(scene, sampled, rings, context)
    places, gain = places_in_image(_ratios(scene, state, sampled))
    if gain is not None:
        state = replace(state, gain_map=full_size(gain, state.outside.shape))
    return Photometry(state, places, parameters.blur_px)


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
    """Re-render frames, compare them with the recorded ones, and say where and why they differ.

    Raises
    ------
    UnusableError
        When no frame could be re-rendered.
    """
    compared, _ = _split(frames, trajectory, parameters.compared)
    if frames.withheld is None:
        context.warn(_NONE_WITHHELD)
    scene = scene_of(probe, trajectory, wall, texture, photometry.blur_px)
    cleaned, places = photometry.state, photometry.places
    gain, state = cleaned.gain_map, replace(cleaned, gain_map=None)
    exposures, comparison = Exposures(), Comparison()
    light = dict(zip(frames.frame.tolist(), frames.illumination.tolist(), strict=True))
    dirty, blocks = dirt(places, state.outside.shape), BlocksOfFrames(scene.surface.mean_radius_mm)
    for done, (frame, image) in enumerate(recording.read(compared, "grey")):
        context.progress(done, len(compared))
        if image is None:
            continue
        kind, above = (
            Illumination(light[frame]),
            image.astype(np.float32) - np.float32(state.noise.black.value),
        )
        before = render_frame(scene, state, frame, kind)
        after = render_frame(scene, cleaned, frame, kind) if gain is not None else before
        exposure = exposure_of(above, after)
        exposures.add(frame, kind, exposure, above, after)
        if kind == Illumination.LED:
            blocks.add(above, before, state.noise.white - state.noise.black.value)
        after = after.brighter(float(np.exp(exposure)), state.noise)
        dirty.add(above, before, after)
        comparison.add(frame, kind, above, before, after, state.noise)
    if not comparison.views:
        raise UnusableError("twin", "no frame could be decoded", hint="copy the video again")
    samples = blocks.samples()
    found: tuple[Mismatch, ...] = (
        *flicker(exposures, state), *dirty.accepted(in_image(samples, places)), *unnamed(samples),
        *of_line(state, rings),
    )  # fmt: skip
    _report(comparison, found, context)
    return Twin(
        np.array([v.frame for v in comparison.views]), frames.withheld is not None,
        noise_figures(state.noise), state_figures(state), comparison.regions(), found,
        comparison.psnr_db(False), comparison.psnr_db(True), comparison.chi2_camera, comparison.stray_share,
        comparison.seen / max(comparison.view, 1.0), cannot_tell(state), tuple(comparison.views),
        maps_of(samples), comparison.levels(),
    )  # fmt: skip


_NONE_WITHHELD = (
    "no frame was withheld from the run, so that the compared frames are ones that wall, motion and photo "
    "were made from: errors that the run has fitted away do not show. What to do: run the recording with "
    "--set premises.withhold=10"
)


def _split(frames: CheckedFrames, trajectory: Trajectory, most: int) -> tuple[Int, Bool]:
    """Return up to ``most`` frames to compare, and which (N,) of all the run has measured."""
    posed = np.isin(frames.frame, trajectory.frame)
    if frames.withheld is None:
        chosen = np.zeros(len(frames.frame), bool)
        chosen[_EVERY // 2 :: _EVERY - 1] = True
        measured = posed
    else:
        chosen, measured = frames.withheld, posed & ~frames.withheld
    compared = frames.frame[chosen & posed]
    few = np.unique(np.linspace(0, len(compared) - 1, min(most, len(compared))).round().astype(int))
    return compared[few], measured


def _ratios(scene: Scene, state: PhotometricState, sampled: list[Sampled]) -> list[Float32]:
    """Return recorded over predicted brightness of blocks of the sampled lit frames."""
    black = state.noise.black.value
    return [
        block_ratios(s.image - black, render_frame(scene, state, s.frame, s.light), state.noise.white - black)
        for s in sampled
        if s.light == Illumination.LED
    ]


def _report(comparison: Comparison, found: tuple[Mismatch, ...], context: Context) -> None:
    for region in comparison.regions():
        context.report(f"chi-square per pixel, {region.name}", region.chi2_after, "")
    context.report("peak signal to noise, lit wall", comparison.psnr_db(False), "dB")
    context.report("the same without the noise", comparison.psnr_db(True), "dB")
    context.report("mismatches found", len(found), "")


PHOTOMETRY = Stage(
    "photometry",
    "2",
    PhotometryParameters,
    measure_photometry,
    "camera noise, lamps, laser line, blur and dirt on the window, from the frames of a run",
)
TWIN = Stage(
    "twin",
    "4",
    TwinParameters,
    compare_with_twin,
    "recorded frames beside the same frames, re-rendered from what the run has measured",
)
