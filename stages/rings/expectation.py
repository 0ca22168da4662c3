"""Warnings about a recording whose rings do not look like those of good recordings."""

from __future__ import annotations

import numpy as np

from pipeline.adjustment.robust import basis_of, ring_harmonics, row_median
from pipeline.arrays import Bool, Byte, Float, Int, runs_of
from pipeline.artefacts.findings import clock_of_azimuth
from pipeline.artefacts.measured import NOT_THE_LINE, RingSamples, RingValidity
from pipeline.machine.stage import Context
from pipeline.pages import notation

# Share of such samples. Good recordings (the three open ones) have 0.06 % at most, seven glints a frame make
# 2.2 %: the geometric middle.
_MOST_NOT_THE_LINE = 0.004
# Share of the line that is lost in any other way: 0 in good recordings. Chosen: from here on a pit of some
# millimetres may lie unseen.
_MOST_UNSEEN = 0.02
# Part of the rings in which an azimuth shows no line, and how far around, from which the sector is named:
# less than half of the rings leave wall between them, and a degree is a millimetre of a 4 inch pipe.
_HIDDEN, _HIDDEN_RAD = 0.5, np.radians(1.0)
# Hidden parts nearer to each other than an hour of the clock have one cause and are reported together.
_ONE_SECTOR_RAD = np.radians(30.0)
# Wander in line widths. Speckle and texture leave 0.06 to 0.10 in good recordings, crf 30 makes 0.15: the
# middle of both.
_MOST_WANDER = 0.12
_NAMED_FRAMES = 8
# Rings, spread evenly over the run, from which the usual ring is known (chosen).
_ENOUGH_RINGS = 512
_OBSCURED = (
    "the laser is hidden or weak there, something is on the window, text is burnt into the picture, or a "
    "branch of the pipe opens there. The wall there is not inspected. What to do: look at the lit pictures; "
    "clean window and laser, switch off the text; record once more with the probe rolled"
)
_CUT_OFF = (
    "the ring leaves the picture there. The wall there is not inspected. What to do: record the whole ring, "
    "with a wider view or without cropping; or record once more with the probe rolled"
)
# A bell sampled at pixels: what folds over is 0.3 of its height at Nyquist with 0.5 px, more below it. Good
# recordings have 0.63 px (open-1 at half its size) or more, at 480 x 360 0.53, at 320 x 240 0.43.
_NARROWEST_PX = 0.5


def warn_of_rings(
    samples: RingSamples, image_size: tuple[int, int], wander_px: float, stepped: bool, context: Context
) -> None:
    """Warn of frames without a ring, sectors without a line, and a line of poor quality.

    ``stepped`` says that the wall is a gauge's: its steps and fiducials break the line by design (0.7 to 2.4
    % of it in the good gauge of open-1), so that the share of broken line is no sign of quality there.
    """
    rejected = samples.validity == RingValidity.FRAME_REJECTED
    ring = ~rejected.all(1)
    if not ring.all():
        _warn_of_no_ring(samples.frame[~ring], len(ring), context)
    validity = samples.validity[ring]
    missing = np.asarray((validity != RingValidity.VALID).mean(0))
    width = float(np.median(samples.width_px[samples.valid]))
    if width < _NARROWEST_PX:
        _warn_of_coarse_pictures(width, float((validity != RingValidity.VALID).mean()), context)
    else:
        _warn_of_sectors(missing, samples.azimuth_rad, _leaves_picture(samples, image_size), context)
        if not stepped:
            _warn_of_shares(validity[:, missing <= _HIDDEN], context)
    if wander_px > _MOST_WANDER * width:
        context.warn(
            f"the line wanders by {wander_px:.2f} px beyond its noise, {wander_px / width:.2f} of its width "
            "(good recordings: 0.1 at most): strong compression, interlacing or coarse speckle. σ includes "
            "this; small defects may be missed. What to do: record with less compression"
        )


def _warn_of_no_ring(frames: Int, looked_at: int, context: Context) -> None:
    more = f" and {len(frames) - _NAMED_FRAMES} more" if len(frames) > _NAMED_FRAMES else ""
    context.warn(
        f"{len(frames)} of {looked_at} laser frames show no ring: frame "
        f"{', '.join(str(f) for f in frames[:_NAMED_FRAMES])}{more}. Their wall is not measured. What to "
        "do: look at these pictures; the laser may have been off or blocked, or the pipe ends there"
    )


def _warn_of_coarse_pictures(width_px: float, lost: float, context: Context) -> None:
    context.warn(
        f"the line is {width_px:.2f} px wide (1 σ), too narrow to be located with these pixels: "
        f"{100 * lost:.1f} % of the ring samples are lost, most near 12, 3, 6 and 9 o'clock in the picture, "
        "where rows of pixels run along the line. What to do: record with more pixels, so that the line is "
        f"{_NARROWEST_PX:g} px wide"
    )


def _warn_of_shares(validity: Byte, context: Context) -> None:
    """Warn of the shares of samples (F, A) that show no line, or other light."""
    unseen = np.isin(validity, (RingValidity.NO_LINE, RingValidity.LOW_CONTRAST, RingValidity.SATURATED))
    other = np.isin(validity, NOT_THE_LINE)
    if validity.size and unseen.mean() > _MOST_UNSEEN:
        context.warn(
            f"{100 * unseen.mean():.1f} % of the ring samples show no measurable line: it is too "
            "faint or clipped, or there is no wall (a branch, an open joint); good recordings lose none. "
            "What to do: check in the model where wall is missing; if the pipe has wall there, correct the "
            "exposure of the laser frames, clean window and laser"
        )
    if validity.size and other.mean() > _MOST_NOT_THE_LINE:
        context.warn(
            f"{100 * other.mean():.1f} % of the ring samples show light that is not the line: glints, "
            "ghosts, splashes or compression (good recordings: 0.1 % at most). They are left out, but some "
            "may remain as false findings of one or two rings. What to do: clean the "
            "window, shade reflections, expose the laser frames less; look at the findings' pictures"
        )


def _leaves_picture(samples: RingSamples, image_size: tuple[int, int]) -> Bool:
    """Return at which azimuths (A,) the smooth ring through the median radii lies outside the picture."""
    samples = samples.some(slice(None, None, max(len(samples.frame) // _ENOUGH_RINGS, 1)))
    basis = basis_of(samples.azimuth_rad)
    middle = row_median(np.where(samples.valid, samples.radius_px, np.nan).T.astype(float))
    ring = (ring_harmonics(middle[None], basis) @ basis.T)[0]
    direction = np.stack([np.cos(samples.azimuth_rad), np.sin(samples.azimuth_rad)], -1)
    uv = samples.centre_px + ring[:, None] * direction
    return np.asarray(((uv < 0) | (uv > np.array(image_size) - 1)).any(1))


def _warn_of_sectors(missing: Float, azimuth_rad: Float, leaves: Bool, context: Context) -> None:
    """Name the sectors in which most rings show no line: ``missing`` is the share of rings (A,).

    ``leaves`` (A,) is where the ring lies outside the picture.
    """
    step = 2 * np.pi / len(azimuth_rad)
    hidden = np.zeros(len(missing), bool)
    for first, count in _runs_around(missing > _HIDDEN):
        if count * step >= _HIDDEN_RAD:
            hidden[(first + np.arange(count)) % len(missing)] = True
    for first, count in _runs_around(_without_gaps(hidden, round(_ONE_SECTOR_RAD / step))):
        sector = (first + np.arange(count)) % len(missing)
        part, cut = hidden[sector].mean(), leaves[sector].mean() > _HIDDEN
        ends = clock_of_azimuth(azimuth_rad[first] + step * np.array([0, count]))
        context.warn(
            f"the line is missing between {notation.clock(float(ends[0]))} and "
            f"{notation.clock(float(ends[1]))} in the picture{_in_parts(float(part))} in most rings: "
            f"{_CUT_OFF if cut else _OBSCURED}"
        )


def _in_parts(share: float) -> str:
    return f", in {100 * share:.0f} % of this sector," if share < 1 else ""


def _without_gaps(mask: Bool, most: int) -> Bool:
    """Return a mask around the circle with the gaps filled that are no longer than ``most``."""
    out = mask.copy()
    for first, count in _runs_around(~mask):
        if count <= most:
            out[(first + np.arange(count)) % len(mask)] = True
    return out


def _runs_around(mask: Bool) -> list[tuple[int, int]]:
    """Return (first, count) of the runs of true cells around the circle."""
    if mask.all() or not mask.any():
        return [(0, len(mask))] if mask.all() else []
    first = int(np.argmin(mask))
    runs = runs_of(np.roll(mask, -first))
    return [((run.start + first) % len(mask), run.stop - run.start) for run in runs]
