"""Loop closure on rendered recordings there and back, against the truth; and welds that must not be confused.

``python -m tests.benchmarks.bench_loops OUT [--length MM] [SCENE ...]``. Scenes (`loop_scenes`) are rendered
into OUT unless they exist, and processed in windows of 150 frames. Printed for each: the difference between
the way out and the way back at the same places, before and after loops are closed; errors against the truth
with their stated 1 σ; and a control, in which frames of the way back with a weld in view are compared with
frames of the way out at another weld, where nothing may be recognised. Both scenes take some 10 min of
processor time at 1.5 m.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float, Int
from pipeline.artefacts.measured import RingPoints, RingSamples, Trajectory
from pipeline.geometry.axis import frames_at, to_pipe
from pipeline.instrument.probe import Probe
from pipeline.instrument.probe_file import read_probe
from pipeline.machine.stage import Context
from pipeline.recording import open_recording
from pipeline.recording.base import Recording
from pipeline.simulator.produce import Order, Places, produce
from stages.accumulate import AccumulateParameters, accumulate_wall
from stages.motion import MotionParameters, estimate_motion
from stages.motion.loops.strip_registration import ExpectedShift, Verdict, register
from stages.motion.tracking.overlap import StoredStrip
from stages.motion.tracking.strips import Strip, StripGrid, WallView
from stages.rings import RingParameters, extract_rings
from stages.triangulate import TriangulateParameters, triangulate_rings
from tests.benchmarks.loop_scenes import SCENES_BY_NAME, WELD_SPACING_MM
from tests.quiet import quiet_context
from tests.truth_comparison import compare_wall

_WINDOWS = {"window_frames": 150, "overlap_frames": 40}
_CONTROL = ExpectedShift(np.zeros(2), np.array([60.0, 30.0]))


@dataclass(frozen=True)
class Measured:
    """A recording with the results that do not depend on loops."""

    recording: Recording
    probe: Probe
    rings: RingSamples
    points: RingPoints
    truth: Path
    T_pc: Float


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument("scenes", nargs="*", default=list(SCENES_BY_NAME))
    words.add_argument("--length", type=float, default=1500.0)
    given = words.parse_args()
    for name in given.scenes:
        measured = _measured(*_rendered(name, given.length, given.out))
        kinds = [True, False] if measured.recording.encoder is not None else [False]
        for encoder in kinds:
            _compare_runs(name, measured, encoder)
        _control(measured)


def _rendered(name: str, length_mm: float, out: Path) -> tuple[Path, Path]:
    scene = SCENES_BY_NAME[name](length_mm)
    places = Places(out / name, out / f"{name}-truth")
    if not places.recording.exists():
        produce([Order(scene, out / f"{name}.yaml", places)], lambda order, done: None)
    return places.recording, places.truth


def _measured(folder: Path, truth: Path) -> Measured:
    recording = open_recording(folder)
    assert recording.probe_file is not None
    probe, context = read_probe(recording.probe_file), quiet_context()
    rings = extract_rings(recording, probe, RingParameters.model_validate({}), context)
    points = triangulate_rings(rings, probe, TriangulateParameters.model_validate({}), context)
    poses = np.array(json.loads((truth / "truth.json").read_text())["camera_pose_in_pipe"])
    return Measured(recording, probe, rings, points, truth, poses)


def _compare_runs(name: str, measured: Measured, encoder: bool) -> None:
    recording = measured.recording if encoder else replace(measured.recording, encoder=None)
    print(f"\n{name}, {len(measured.T_pc)} frames, {'with' if encoder else 'without'} encoder", flush=True)
    for most in (0, 100):
        told: dict[str, float | int | str] = {}
        parameters = MotionParameters.model_validate(_WINDOWS | {"most_loops": most})
        found = estimate_motion(
            recording, measured.probe, measured.rings, measured.points, parameters, _telling(told)
        )
        print(f"  {'loops closed' if most else 'as it was'}")
        _print_errors(found, measured.T_pc)
        _print_wall(found, measured)
        if most:
            for words in (w for w in told if "loop" in w or "seen before" in w):
                print(f"    {words}: {told[words]}")


def _telling(told: dict[str, float | int | str]) -> Context:
    def tell(name: str, value: float | int | str, unit: str = "") -> None:
        told[name] = value

    return replace(quiet_context(), report=tell)


def _print_errors(found: Trajectory, true_T_pc: Float) -> None:
    """Print differences between the ways out and back, and the errors at the last lit frame but one."""
    distance, roll, aside = _errors(found, true_T_pc)
    there, here = _pairs(true_T_pc[:, 2, 3])
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    last, first = here[-1], there[-1]
    gaps = [_rms(e[here] - e[there]) for e in (distance, np.degrees(roll))]
    print(f"    way back off the way out, rms: distance {gaps[0]:.3f} mm, roll {gaps[1]:.4f} deg")
    most = float(np.abs(aside).max())
    print(f"    camera across the pipe off the truth, rms: {_rms(aside):.3f} mm, most {most:.3f} mm")
    for what, frame in (("out", first), ("turn", len(distance) // 2), ("back", last)):
        off = np.degrees(roll[frame])
        print(
            f"    {what:<5} frame {frame:>4}: distance {distance[frame]:+.3f} ± {sigma[frame, 2]:.3f} mm, "
            f"roll {off:+.4f} ± {np.degrees(sigma[frame, 5]):.4f} deg"
        )


def _print_wall(found: Trajectory, measured: Measured) -> None:
    """Print the errors of the wall made from both ways together."""
    parameters, context = AccumulateParameters.model_validate({}), quiet_context()
    wall = accumulate_wall(measured.probe, measured.rings, measured.points, found, parameters, context)
    compared = compare_wall(wall.radius_map, measured.truth)
    print(
        f"    wall's radius off the truth: 1 σ of most {compared.robust_sigma_mm:.3f} mm, rms with welds "
        f"{_rms(compared.error_mm):.3f} mm, inside the stated 95 %: {100 * compared.inside_95:.0f} %"
    )


def _errors(found: Trajectory, true_T_pc: Float) -> tuple[Float, Float, Float]:
    """Return errors of distance, mm, and roll, rad, since the first frame, and (N, 2) across the axis, mm."""
    s = to_pipe(found.axis, found.T_pc[:, :3, 3])[0]
    origin, section = frames_at(found.axis, s)
    own = np.einsum("nji,njk->nik", section, found.T_pc[:, :3, :3])
    roll, true_roll = (np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0])) for T in (own, true_T_pc))
    across = np.einsum("nji,nj->ni", section, found.T_pc[:, :3, 3] - origin)[:, :2]
    c, sn = np.cos(roll[0] - true_roll[0]), np.sin(roll[0] - true_roll[0])
    off = across @ np.array([[c, -sn], [sn, c]]) - true_T_pc[:, :2, 3]
    true_s = true_T_pc[:, 2, 3]
    return s - s[0] - true_s + true_s[0], roll - roll[0] - true_roll + true_roll[0], off


def _pairs(true_s: Float) -> tuple[Int, Int]:
    """Return lit frames of the ways out and back at the same place, without the last few frames."""
    lit, turn = np.arange(1, len(true_s) - 4, 2), int(np.argmax(true_s))
    here = lit[lit > turn + 30]
    out = lit[lit < turn]
    there = out[np.argmin(np.abs(true_s[out] - true_s[here][:, None]), 1)]
    return there, here


def _rms(value: Float) -> float:
    return float(np.sqrt(np.mean(value**2)))


def _control(measured: Measured) -> None:
    """Compare frames of the way back with those of the way out that see another weld of the same look."""
    parameters = MotionParameters.model_validate({})
    radius_mm = measured.recording.pipe.nominal_diameter_mm / 2
    near, far = (
        radius_mm / np.tan(np.radians(a)) for a in (parameters.near_angle_deg, parameters.far_angle_deg)
    )
    columns = max(round(2 * np.pi * radius_mm / parameters.strip_step_mm / 4), 60) * 4
    view = WallView(measured.recording, measured.probe, StripGrid(radius_mm, columns, near, far))
    there, here = _pairs(measured.T_pc[:, 2, 3])
    s = measured.T_pc[:, 2, 3]
    sees_weld = (
        np.abs((s[here] + (near + far) / 2) % WELD_SPACING_MM - WELD_SPACING_MM / 2) < (far - near) / 3
    )
    there, here = there[sees_weld], here[sees_weld]
    T_pc = np.tile(np.eye(4), (len(s), 1, 1))
    T_pc[:, :3] = measured.T_pc[:, :3]
    strips = _strips(view, T_pc, np.unique(np.concatenate([there, here])))
    told = {True: [0, 0], False: [0, 0]}
    for a in there:
        for b in here:
            apart = round((s[b] - s[a]) / WELD_SPACING_MM) * WELD_SPACING_MM
            if abs(s[b] - s[a] - apart) > 12.0 or b <= a:
                continue
            earlier = replace(
                StoredStrip.of(strips[int(a)]),
                first_row=strips[int(a)].first_row + round(apart / view.grid.step_mm),
            )
            found = register([earlier], strips[int(b)], _CONTROL, parameters)
            told[apart == 0][0] += 1
            told[apart == 0][1] += found.verdict is Verdict.SAME
    print(f"  control: the same weld recognised in {told[True][1]} of {told[True][0]} pairs,")
    print(
        f"           another weld, all equal and equally spaced, in {told[False][1]} of {told[False][0]}",
        flush=True,
    )


def _strips(view: WallView, T_pc: Float, frames: Int) -> dict[int, Strip]:
    return {
        int(k): strip
        for k, strip in zip(frames, view.strips(frames, T_pc[frames]), strict=True)
        if strip is not None
    }


if __name__ == "__main__":
    main()
