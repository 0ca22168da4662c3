"""A stretch of a field recording as a recording of its own, for judging on what was held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.adjustment.bordered import LandmarkRows, Rows
from pipeline.arrays import Bool, Int
from stages.diagnose.field.run import FieldRun
from stages.motion import EncoderReadings, Equations, RingBins, Tracks

_SEEN_OFTEN = 3


def part_of(run: FieldRun, first: int, end: int) -> FieldRun:
    """Return the run's frames from ``first`` up to ``end``, with the weights they had in the whole."""
    tracks, rings = run.measured.tracks, run.measured.rings
    of_ring = (rings.frame >= first) & (rings.frame < end)
    seen = (tracks.frame >= first) & (tracks.frame < end)
    kept = np.bincount(tracks.landmark[seen], minlength=len(run.state.xyz_p)) >= _SEEN_OFTEN
    seen &= kept[tracks.landmark]
    state = replace(
        run.state, T_pc=run.state.T_pc[first:end], slip=run.state.slip[first:end], xyz_p=run.state.xyz_p[kept]
    )
    measured = replace(
        run.measured, tracks=_tracks(tracks, seen, kept, first), rings=_bins(rings, of_ring, first),
        time_s=run.measured.time_s[first:end],
    )  # fmt: skip
    equations = Equations(
        end - first, (), _ring_rows(run.equations.rings, of_ring, first),
        _landmark_rows(run.equations.texture, seen, kept, tracks.landmark, first),
    )  # fmt: skip
    return replace(
        run, state=state, measured=measured, equations=equations, encoder=_readings(run.encoder, first, end),
        ring_frames=run.ring_frames - first,
    )  # fmt: skip


def _tracks(tracks: Tracks, seen: Bool, kept: Bool, first: int) -> Tracks:
    number = np.cumsum(kept) - 1
    return replace(
        tracks, landmark=number[tracks.landmark[seen]], frame=tracks.frame[seen] - first, uv=tracks.uv[seen],
        sigma_px=tracks.sigma_px[seen], xyz=tracks.xyz[kept],
    )  # fmt: skip


def _bins(rings: RingBins, of_ring: Bool, first: int) -> RingBins:
    return RingBins(
        rings.frame[of_ring] - first,
        rings.xyz_c[of_ring],
        rings.by_instrument[of_ring],
        rings.sigma_mm[of_ring],
    )


def _ring_rows(rows: Rows, keep: Bool, first: int) -> Rows:
    return replace(
        rows, frame=rows.frame[keep] - first, by_frame=rows.by_frame[keep], by_border=rows.by_border[keep],
        residual=rows.residual[keep], sigma=rows.sigma[keep],
    )  # fmt: skip


def _landmark_rows(rows: LandmarkRows, seen: Bool, kept: Bool, landmark: Int, first: int) -> LandmarkRows:
    count = np.bincount(landmark[seen], minlength=len(kept))[kept]
    return replace(
        rows, start=np.concatenate([[0], np.cumsum(count)]), frame=rows.frame[seen] - first,
        by_pose=rows.by_pose[seen], by_point=rows.by_point[seen], by_instrument=rows.by_instrument[seen],
        residual=rows.residual[seen], sigma=rows.sigma[seen], surface_by_point=rows.surface_by_point[kept],
        surface_by_border=rows.surface_by_border[kept], surface_residual=rows.surface_residual[kept],
        surface_sigma=rows.surface_sigma[kept],
    )  # fmt: skip


def _readings(encoder: EncoderReadings | None, first: int, end: int) -> EncoderReadings | None:
    if encoder is None:
        return None
    return replace(encoder, distance_mm=encoder.distance_mm[first:end], known=encoder.known[first:end])
