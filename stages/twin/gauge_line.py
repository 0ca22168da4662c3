"""Re-render the laser line of a gauge run with an instrument, to check whether a diagnosis makes it fit.

In an inspection an instrument's error may hide, since wall and poses are measured with the same instrument.
In a gauge run it cannot: the bore is known, and only fiducials determine the camera's pose, rings do not. The
line's light (its brightness in each block of 1.5° and its profile) is taken from the recording; the line's
place is predicted by the simulator. Pixels about the line are compared, as far from steps of the bore and
from fiducials as the calibration requires.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field
from threadpoolctl import threadpool_limits

from pipeline.adjustment.motion_priors import local_third_difference_sigma
from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.artefacts.twin import GaugeTwin
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import inverse, transform
from pipeline.machine.stage import Context, Of, Stage
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.simulator.effects import switch_on
from pipeline.simulator.effects.switch import Switch, parse_switches, the_other_way
from pipeline.simulator.instrument import TrueCamera
from pipeline.simulator.rays import viewing_rays
from pipeline.simulator.sheet import room_mm
from pipeline.simulator.truth import SceneTruth
from stages.calibrate.gauge import MeasuredRun
from stages.calibrate.gauge.adjust import adjust
from stages.calibrate.gauge.state import GaugeParameters
from stages.diagnose.channels import GaugeMeasured
from stages.twin.cells import sigmas
from stages.twin.gauge_scene import gauge_scene
from stages.twin.line_blocks import BlockLight, LineBlocks, blocks_of, light_of, squares

_SOLVE, _SLOPE_PX, _FARTHEST_PX, _SETTLED_PX = 5, 0.5, 6.0, 0.02
_SURE = 3.0
"""σ, from frame to frame, of a difference of χ² above which one instrument fits better than another."""
_PROBED_PX, _NOTICED = 0.2, 0.1
"""The sensitivity is stated as the displacement that raises χ² by a tenth, extrapolated from one of 0.2
px."""
_PLACE_ROUNDS, _PLACE_STEPS = 2, 3
"""Rounds in which the effects' shifts of the fiducials are predicted, and Gauss-Newton steps of the poses per
round."""
_NEWTON = 8
"""Steps that find the point that a pixel sees; each makes the miss about ten times smaller."""


class GaugeLineParameters(GaugeParameters):
    """Parameters of the twin of a gauge run."""

    effects: tuple[str, ...] = Field((), description="effects to be switched on, written as for simulate")
    frames: int = Field(40, ge=4, le=400, description="most laser frames that are compared")


def compare_gauge_line(
    recording: Annotated[Recording, Of("gauge")],
    frames: Annotated[CheckedFrames, Of("gauge")],
    rings: Annotated[RingSamples, Of("gauge")],
    fiducials: Annotated[GaugeMeasured, Of("gauge")],
    *,
    parameters: GaugeLineParameters,
    context: Context,
) -> GaugeTwin:
    """Re-render the line of a gauge run with the stated instrument and with effects switched on.

    Raises
    ------
    InputError
        When an effect is unknown or does not fit the scene.
    UnusableError
        When there are too few fiducials or rings.
    """
    if fiducials.run is None:
        raise UnusableError("gauge_line", fiducials.problem, hint="record the gauge run again")
    line = gauge_line_of(frames.applied_to(recording), rings, fiducials.run, parameters)
    switches = parse_switches(parameters.effects)
    less = [tuple(s for s in switches if s is not left) for left in switches] if len(switches) > 1 else []
    place = []
    wrong = tuple(the_other_way(s) for s in switches)
    for done, chosen in enumerate(((), switches, wrong, *less)):
        context.progress(done, 3 + len(less))
        place.append(line.displacement_px(chosen))
    found = _judged(line, switches, place)
    context.report("chi-square per pixel of the gauge's line, as stated", found.chi2_stated, "")
    context.report("the same with what was diagnosed", found.chi2_diagnosed, "")
    return found


@dataclass(frozen=True)
class GaugeLine:
    """The line of a gauge run, to be compared with instruments; made by `gauge_line_of`.

    Attributes
    ----------
    recording : Recording
    run : MeasuredRun
    parameters : GaugeLineParameters
    blocks : LineBlocks
    light : BlockLight
    """

    recording: Recording
    run: MeasuredRun
    parameters: GaugeLineParameters
    blocks: LineBlocks
    light: BlockLight

    def displacement_px(self, effects: Sequence[Switch]) -> Float:
        """Return how far (B,), px, the stated instrument with effects puts the line beyond the ring."""
        with threadpool_limits(1):
            scene = scene_with(self.recording, self.run, effects, self.parameters)
            return _displacement_px(scene, self.blocks)

    def chi2(self, displacement_px: Float) -> Float:
        """Return χ² per pixel (F,) of the frames for a line with such a displacement (B,), px."""
        each = squares(self.blocks, self.light, displacement_px) / self.light.variance
        return np.bincount(self.blocks.of_frame[self.blocks.block], each) / self.pixels

    @property
    def pixels(self) -> Int:
        """(F,) number of compared pixels in each frame."""
        return np.bincount(self.blocks.of_frame[self.blocks.block])


def gauge_line_of(
    recording: Recording, rings: RingSamples, run: MeasuredRun, parameters: GaugeLineParameters
) -> GaugeLine:
    """Read the laser frames of a gauge run whose fiducials and rings are measured.

    Raises
    ------
    UnusableError
        When too few laser frames are near frames with fiducials.
    """
    blocks = blocks_of(recording, rings, run, parameters.frames)
    return GaugeLine(recording, run, parameters, blocks, light_of(blocks))


def _displacement_px(scene: SceneTruth, blocks: LineBlocks) -> Float:
    """Return how far (B,), px, a scene's line lies beyond the measured ring; NaN where it has none nearby."""
    out = np.full(len(blocks.of_frame), np.nan)
    for k, frame in enumerate(blocks.frame):
        here = blocks.of_frame == k
        azimuth, ring = blocks.azimuth_rad[here], blocks.measured_px[here]
        outward = np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
        moved, step = np.zeros(len(ring)), np.zeros(len(ring))
        for _ in range(_SOLVE):
            uv = blocks.centre_px + (ring + moved)[:, None] * outward
            room, beyond = (room_mm(scene, int(frame), uv + d * outward) for d in (0.0, _SLOPE_PX))
            step = np.clip(_SLOPE_PX * room / (room - beyond), -_FARTHEST_PX, _FARTHEST_PX)
            moved = moved + step
        out[here] = np.where(np.abs(step) < _SETTLED_PX, moved, np.nan)
    return out


def scene_with(
    recording: Recording, run: MeasuredRun, effects: Sequence[Switch], parameters: GaugeParameters
) -> SceneTruth:
    """Return a gauge run's scene with the stated instrument and effects; fiducials determine the poses.

    Raises
    ------
    InputError
        When an effect does not fit the scene.
    """
    start = run.start
    # One unknown without effect: the adjustment may move poses and fiducials, but not the instrument.
    state = replace(start, instrument=np.zeros(1), unsure=np.zeros((len(start.stated.parameters), 1)))
    no_rings = run.measured.rings.select(np.zeros(len(run.measured.rings.frame), bool))
    smooth = local_third_difference_sigma(start.T_pc, run.measured.time_s, run.posed)
    measured = replace(run.measured, rings=no_rings, smooth_sigma=smooth)
    edges = run.measured.edges
    for _ in range(_PLACE_ROUNDS):
        scene = switch_on(gauge_scene(recording, start.stated, state.T_pc), effects)
        shifted = replace(edges, uv=edges.uv - _shift_px(scene, edges.frame, edges.xyz_p))
        for _ in range(_PLACE_STEPS):
            state = adjust(state, replace(measured, edges=shifted), parameters).state
    return switch_on(gauge_scene(recording, start.stated, state.T_pc), effects)


def _shift_px(scene: SceneTruth, frame: Int, xyz_p: Float) -> Float:
    """Return the scene camera's image of points (M, 3) in P, mm, minus the stated camera's (M, 2), px."""
    out = np.zeros((len(frame), 2))
    for number in np.unique(frame):
        here = frame == number
        time_s = scene.frames.time_s[number]
        xyz_c = transform(inverse(scene.motion.pose(time_s, scene.wall.axis)), xyz_p[here])
        out[here] = (
            seen_at(scene.instrument_at(float(time_s)).camera, xyz_c) - scene.stated.camera.project(xyz_c).uv
        )
    return np.nan_to_num(out)


def seen_at(camera: TrueCamera, xyz_c: Float) -> Float:
    """Return the pixels (M, 2) whose viewing rays pass through points (M, 3) in C, mm."""
    uv = camera.model.project(xyz_c).uv
    by_point = camera.model.project_jacobian(xyz_c).by_point
    for _ in range(_NEWTON):
        origin, ray = viewing_rays(camera, uv)
        from_origin = xyz_c - origin
        miss = from_origin - np.sum(from_origin * ray, -1, keepdims=True) * ray
        uv = uv + np.einsum("mij,mj->mi", by_point, miss)
    return np.asarray(uv)


def _judged(line: GaugeLine, switches: Sequence[Switch], place: Sequence[Float]) -> GaugeTwin:
    """Return χ² for the line's places as stated, with all effects, with wrong ones, and without each one."""
    blocks, pixels = line.blocks, line.pixels
    stated, diagnosed, wrong, *less = (line.chi2(p) for p in place)
    nowhere = np.zeros(len(blocks.of_frame))
    measured = line.chi2(nowhere)
    rise = line.chi2(nowhere + _PROBED_PX) - measured
    without = less or [stated] * len(switches)
    kept = [sigmas(left - diagnosed) > _SURE for left in without]
    return GaugeTwin(
        line.recording.frames.frame[blocks.frame], tuple(s.text for s in switches), int(pixels.sum()),
        _mean(stated, pixels), _mean(diagnosed, pixels), _mean(measured, pixels),
        _rms(place[0]), _rms(place[1]),
        float(_PROBED_PX * np.sqrt(_NOTICED * _mean(measured, pixels) / max(_mean(rise, pixels), 1e-9))),
        sigmas(stated - diagnosed), tuple(kept), _mean(wrong, pixels), sigmas(wrong - diagnosed),
    )  # fmt: skip


def _mean(chi2: Float, pixels: Int) -> float:
    return float((chi2 * pixels).sum() / pixels.sum())


def _rms(displacement_px: Float) -> float:
    return float(np.sqrt(np.nanmean(displacement_px**2)))


GAUGE_LINE = Stage(
    "gauge_line",
    "4",
    GaugeLineParameters,
    compare_gauge_line,
    "the line of a gauge run beside the same line, re-rendered with what was diagnosed",
)
