"""The checks before and after rendering."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.recording.folder import open_folder
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.premises.base import Premise, require
from pipeline.simulator.premises.effect import effect_premises
from pipeline.simulator.premises.pictures import chosen_frames, picture_premises
from pipeline.simulator.premises.sampling import line_premise
from pipeline.simulator.render import Renderer
from pipeline.simulator.truth import SceneTruth


def require_scene(plain: SceneTruth, switches: Sequence[Switch], renderer: Renderer) -> tuple[Premise, ...]:
    """Return what holds of a scene before it is rendered; see `require`.

    Parameters
    ----------
    plain : SceneTruth
        The scene without its effects.
    switches : sequence of Switch
        Its effects.
    renderer : Renderer
        Of the scene with them.
    """
    truth = renderer.truth
    pictures = {n: renderer.frame(n) for n in chosen_frames(truth)}
    drawn = [line_premise(truth), *picture_premises(truth, pictures)]
    return require([*drawn, *effect_premises(plain, switches)])


def require_recording(folder: Path, truth: SceneTruth) -> tuple[Premise, ...]:
    """Return what holds of a recording as stored; see `require`."""
    recording = open_folder(folder)
    frames = chosen_frames(truth)
    pictures = {n: image.copy() for n, image in recording.read(frames, "bgr") if image is not None}
    lost = Premise("frames that cannot be read back", float(len(frames) - len(pictures)), 0.0, at_most=True)
    return require([lost, *picture_premises(truth, pictures)])
