"""Leaves out what cannot lie on the wall of the stated pipe: samples too far away, and rings at its end."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.circles import LEAST_COVERED
from pipeline.arrays import Bool, Float32, Int
from pipeline.artefacts.measured import RingSamples
from pipeline.errors import UnusableError
from pipeline.machine.stage import Context
from pipeline.recording.base import PipeFacts

# The camera is inside the pipe: no wall lies farther from it than the pipe is wide. Premises refuses a stated
# diameter that is wrong by a factor of 1.5.
_FARTHEST_WALL = 1.5
# A ring, or a run, of which more than this share lies farther off did not show the pipe (chosen).
_MOST_IMPOSSIBLE = 0.5
# Share of such samples that is warned of: as in accumulate, a branch of half of the diameter in a metre of
# pipe has more.
_FEW_IMPOSSIBLE = 0.002
# Rings without a circle at either end of a run that are an end, and not a few bad pictures: as in premises.
A_WHILE = 8


def farthest_wall_mm(pipe: PipeFacts | None) -> float:
    """Return the largest distance from the camera's axis, mm, at which wall of the stated pipe may lie."""
    widest_mm = (
        np.inf if pipe is None else max(pipe.nominal_diameter_mm, *(b.diameter_mm for b in pipe.bore), 0)
    )
    return float(_FARTHEST_WALL * widest_mm)


def beyond_the_wall(rho_mm: Float32, farthest_mm: float) -> Bool:
    """Return where samples (F, A) lie farther off than any wall: single ones, and rings that mostly do.

    ``rho_mm`` (F, A) is the distance from the camera's axis; NaN where there is no sample.
    """
    far = rho_mm > farthest_mm
    known = np.isfinite(rho_mm)
    rings = far.sum(1) > _MOST_IMPOSSIBLE * known.sum(1)
    return np.asarray(far | (known & rings[:, None]))


def rings_at_an_end(xyz_c: Float32) -> list[slice]:
    """Return the rings before the first, and behind the last, of whose circle enough is seen; if many.

    What is left of a ring there is the rim of the pipe, or another light: behind the end of a pipe the laser
    meets no wall.
    """
    covered = np.flatnonzero(np.isfinite(xyz_c[..., 0]).mean(1) > LEAST_COVERED)
    if not covered.size:
        return []
    ends = slice(0, int(covered[0])), slice(int(covered[-1]) + 1, len(xyz_c))
    return [end for end in ends if end.stop - end.start > A_WHILE]


def judge_impossible(
    count: Int, possible: int, rings: RingSamples, farthest_mm: float, context: Context
) -> None:
    """Report, warn of or refuse samples, ``count`` (F,) of each ring, that are farther off than any wall."""
    context.report("rejected: farther away than the stated pipe is wide", int(count.sum()), "samples")
    share = float(count.sum() / max(count.sum() + possible, 1))
    if share <= _FEW_IMPOSSIBLE:
        return
    frames = rings.frame[count > 0]
    problem = f"{100 * share:.2g} % of the ring samples lie more than {farthest_mm:.4g} mm from the camera"
    why = "1.5 times the diameter of the stated pipe, inside of which the camera is"
    cause = "Probably the end of the pipe or an opening is in view"
    if share > _MOST_IMPOSSIBLE:
        raise UnusableError(
            "triangulate", f"{problem}. {cause}, so that the laser meets no wall",
            limit=f"{100 * _MOST_IMPOSSIBLE:.0f} % beyond {why}", frames=frames.tolist(),
            hint="look at these pictures, and keep only the part of the recording in which the line goes "
            "round the wall; else check pipe.nominal_diameter_mm in recording.yaml and the probe file",
        )  # fmt: skip
    context.warn(
        f"{problem} ({why}), in {len(frames)} frames from {frames[0]} to {frames[-1]}. {cause}. They are not "
        "taken for wall, and neither is the rest of a ring that mostly lies there. What to do: look at these "
        "pictures, and keep only the part of the recording in which the line goes round the wall"
    )


def warn_of_end(frame: Int, context: Context) -> None:
    """Warn that the rings of the frames (N,) show no wall up to an end of the run."""
    context.warn(
        f"from frame {frame[0]} to {frame[-1]} no ring shows more than {100 * LEAST_COVERED:.0f} % of its "
        "circle: the end of the pipe or an opening is in view, or the laser is off or hidden. Nothing there "
        "is taken for wall. What to do: nothing, if the pipe ends there; else look at these pictures"
    )
