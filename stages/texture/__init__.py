"""Texture: lit frames, motion and wall to the wall's photo as a flat picture."""

from __future__ import annotations

from pipeline.artefacts.measured import Trajectory, Wall, WallTexture
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from stages.texture.texture import TextureParameters, photograph_wall


def _texture_of_run(
    recording: Recording,
    frames: CheckedFrames,
    probe: Probe,
    trajectory: Trajectory,
    wall: Wall,
    parameters: TextureParameters,
    context: Context,
) -> WallTexture:
    """Photograph the wall from the frames that the pictures show to be lit.

    Poses and wall are those of the instrument as the motion found it, and so the pixels must be.
    """
    found = probe.as_found_in(trajectory)
    return photograph_wall(frames.applied_to(recording), found, trajectory, wall, parameters, context)


TEXTURE = Stage(
    "texture",
    "6",
    TextureParameters,
    _texture_of_run,
    "lit frames to the wall's photo as a flat picture, evenly lit, as bright as recorded",
)
