"""What a field recording can no longer tell, and why, in plain sentences."""

from __future__ import annotations

import numpy as np

from pipeline.physics.effect import Channel
from pipeline.recording.base import Illumination, Recording
from stages.diagnose.field.run import FieldRun
from stages.diagnose.inference import ChannelEvidence, Evidence

# Relative error of a nominal diameter: pipes are made to about 1 %, of which this is 3 σ.
_DIAMETER_SHARE = 0.03
_SHORTEST_MM = 40.0
_LOST_SHARE = 0.25
_LEAST_OFFSET_MM = 0.5
_LEAST_ROLL_RAD = np.radians(5.0)


def nothing_said(recording: Recording, problem: str) -> ChannelEvidence:
    """Return empty evidence of a recording whose motion rings and texture do not determine, and why."""
    lit = len(recording.frames.of(Illumination.LED, Illumination.BOTH))
    why = problem or "its equations leave the motion open"
    sentences = [f"The field recording tells nothing of the instrument by itself: {why}."]
    if not lit:
        sentences.append(
            "No frame of the field shows the wall's texture, so nothing but the rings places the probe."
        )
    sentences.append("A pose that only the ring gives takes up what the sheet or the lens do to it.")
    none = Evidence((), np.zeros((0, 0)), np.zeros(0), np.zeros((0, 0)), 0.0, 0.0)
    return ChannelEvidence("field", Channel.RING, none, shortcomings=tuple(sentences))


def shortcomings_of(run: FieldRun) -> tuple[str, ...]:
    """Return what this field recording cannot tell."""
    return (*_diameter(run), *_length(run), *_texture(run), *_sweep(run), *_one_bore())


def _diameter(run: FieldRun) -> tuple[str, ...]:
    nominal, found = run.recording.pipe.nominal_diameter_mm, 2 * float(run.state.globals[0])
    if abs(found / nominal - 1) < _DIAMETER_SHARE:
        return ()
    return (
        f"The rings show a pipe of {found:.1f} mm, not of {nominal:.1f} mm as stated: either the statement "
        "or the baseline or the lens is wrong, which a pipe of unknown size does not tell.",
    )  # fmt: skip


def travels(run: FieldRun) -> bool:
    """Return whether the probe travels far enough that agreement means anything."""
    return _way_mm(run) > _SHORTEST_MM


def _way_mm(run: FieldRun) -> float:
    return float(np.abs(np.diff(run.trajectory.T_pc[:, 2, 3])).sum())


def _length(run: FieldRun) -> tuple[str, ...]:
    way = _way_mm(run)
    if way > _SHORTEST_MM:
        return ()
    return (
        f"The probe travels only {way:.0f} mm: relief of the wall is not told from errors of the instrument, "
        "nor drift from the pipe's own shape.",
    )  # fmt: skip


def _texture(run: FieldRun) -> tuple[str, ...]:
    is_lost = run.measured.tracks.poses.lost[1:]
    lost = float(np.mean(is_lost)) if len(is_lost) else 1.0
    if lost < _LOST_SHARE:
        return ()
    return (
        f"In {100 * lost:.0f} % of the lit frames there is too little texture: poses lean on the rings "
        "there, which take up what tilt and decentring do.",
    )  # fmt: skip


def _sweep(run: FieldRun) -> tuple[str, ...]:
    out = []
    T = run.trajectory.T_pc
    across = float(np.sqrt(np.mean(np.var(T[:, :2, 3], axis=0))))
    if across < _LEAST_OFFSET_MM:
        out.append(
            f"The probe moves across the pipe by only {across:.2f} mm (1 σ): a shifted image is hardly told "
            "from a tilted or decentred sheet."
        )
    roll = np.unwrap(np.arctan2(T[:, 1, 0], T[:, 0, 0]))
    if float(np.ptp(roll)) < _LEAST_ROLL_RAD:
        out.append(
            f"The probe rolls by only {np.degrees(np.ptp(roll)):.1f}°: what has two waves around the ring is "
            "not told from an oval pipe."
        )
    return tuple(out)


def _one_bore() -> tuple[str, ...]:
    return (
        "One pipe of unknown diameter does not tell cone, focal length, pupil and windows apart, and hides "
        "the baseline but for encoder and texture.",
    )
