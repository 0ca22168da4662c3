"""Twin: recorded frames beside the same frames, re-rendered from what a run has measured."""

from __future__ import annotations

from dataclasses import replace

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
from stages.twin.locate import full_size, places_in_image
from stages.twin.name import Exposures, cannot_tell, dirt, flicker, noise_figures, of_line, state_figures
from stages.twin.render import render_frame
from stages.twin.scene import Scene, scene_of
from stages.twin.state import PhotometricState, Sampled, estimate_state, sample_frames

_EVERY = 10


class TwinParameters(Parameters):
    """Parameters of the twin."""

    sampled: int = Field(
        12,
        ge=3,
        le=200,
        description="measured frames of each light that lamps, laser and noise are taken from",
    )
    compared: int = Field(
        60, ge=2, le=1000, description="most frames that are re-rendered, spread over the recording"
    )
    blur_px: float = Field(
        0.9, ge=0.3, le=5.0, description="1 σ of lens and pixel that the photo is seen with"
    )


def compare_with_twin(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    rings: RingSamples,
    trajectory: Trajectory,
    wall: Wall,
    texture: WallTexture,
    parameters: TwinParameters,
    context: Context,
) -> Twin:
    """Re-render frames, compare them with the recorded ones, and say where and why they differ.

    Raises
    ------
    UnusableError
        When no frame could be re-rendered.
    """
    compared, measured = _split(frames, trajectory, parameters.compared, context)
    scene = scene_of(probe, trajectory, wall, texture, parameters.blur_px)
    sampled = sample_frames(
        recording, frames.frame[measured], frames.illumination[measured], parameters.sampled
    )
    state = estimate_state(scene, sampled, rings, context)
    places, gain = places_in_image(_ratios(scene, state, sampled))
    cleaned = state if gain is None else replace(state, gain_map=full_size(gain, state.outside.shape))
    exposures, comparison = Exposures(), Comparison()
    light = dict(zip(frames.frame.tolist(), frames.illumination.tolist(), strict=True))
    dirty = dirt(places, state.outside.shape)
    for done, (frame, image) in enumerate(recording.read(compared, "grey")):
        context.progress(len(compared) + done, 2 * len(compared))
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
        after = after.brighter(float(np.exp(exposure)), state.noise)
        dirty.add(above, before, after)
        comparison.add(frame, kind, above, before, after, state.noise.black.value)
    if not comparison.views:
        raise UnusableError("twin", "no frame could be decoded", hint="copy the video again")
    found: tuple[Mismatch, ...] = (*flicker(exposures, state), *dirty.accepted(), *of_line(state, rings))
    _report(comparison, found, context)
    return Twin(
        np.array([v.frame for v in comparison.views]), frames.withheld is not None,
        noise_figures(state.noise), state_figures(state), comparison.regions(), found,
        comparison.psnr_db(False), comparison.psnr_db(True),
        comparison.seen / max(comparison.view, 1.0), cannot_tell(state), tuple(comparison.views),
    )  # fmt: skip


def _split(frames: CheckedFrames, trajectory: Trajectory, most: int, context: Context) -> tuple[Int, Bool]:
    """Return the frames to compare, and which (N,) of all the run has measured."""
    posed = np.isin(frames.frame, trajectory.frame)
    withheld = frames.withheld
    if withheld is None:
        context.warn(
            "no frame was withheld from the run, so that the compared frames are ones that wall, motion and "
            "photo were made from: errors that the run has fitted away do not show. What to do: run the "
            "recording with --set premises.withhold=10"
        )
        withheld = np.zeros(len(frames.frame), bool)
        withheld[_EVERY // 2 :: _EVERY - 1] = True
        compared = frames.frame[withheld & posed]
        measured = posed
    else:
        compared, measured = frames.frame[withheld & posed], posed & ~withheld
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


TWIN = Stage(
    "twin",
    "1",
    TwinParameters,
    compare_with_twin,
    "recorded frames beside the same frames, re-rendered from what the run has measured",
)
