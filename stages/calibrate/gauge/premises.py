"""Requirements on a gauge run before and after the adjustment; each refusal says what is wrong."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from pipeline.arrays import Float, Int
from pipeline.errors import InputError, UnusableError
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.camera import Camera
from pipeline.machine.stage import Context
from pipeline.recording.base import Illumination, Recording
from stages.calibrate.gauge.edges import Sighting, detect, detector
from stages.calibrate.gauge.geometry import Gauge, gauge_of
from stages.calibrate.gauge.poses import PosedFrames, disagreeing
from stages.calibrate.gauge.state import GaugeParameters
from stages.calibrate.gauge.white import BELOW_WHITE_GREY, LOOKED_AT, brightest_grey

STAGE = "calibrate"
# Fiducials of another size are refused beyond this share, of small ones beyond the error of a side between
# found corners (drawn ones err by up to .9 px). Where the white beside them is overexposed, all corners move
# inward: a side of 25 px was measured 1.4 px too short, and 2 px are let pass.
_SIZE_TOLERANCE, _SIDE_ERROR_PX, _OVEREXPOSED_PX = 0.05, 1.0, 2.0
# The white beside a fiducial is looked at so many times as far from its middle as its corners are: 0.9 cells
# outside a marker of 6 × 6 cells, border included.
_BESIDE = 1.3
# Added to hints, since a recorder that scales or cuts the pictures looks like a wrong gauge: with pictures
# scaled by 3 % the bores were blamed, with cut ones 24 fiducials.
_PICTURES = "check whether the recorder scales, stretches, cuts or frames the pictures"
_WRONG_BORE_MM = 4.0
_WRONG_SHARE = 0.2
_OTHERS = ("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL")


def require_gauge(recording: Recording) -> Gauge:
    """Return the gauge; refuse a recording that describes none."""
    facts = recording.pipe
    if not facts.bore or facts.fiducials is None or not facts.fiducials.markers:
        missing = "bore" if not facts.bore else "fiducials"
        raise InputError(
            recording.path, f"describes no {missing}: it is not a gauge run", place="pipe",
            hint="give the gauge's bore and fiducials in recording.yaml, or name the gauge's recording",
        )  # fmt: skip
    if not hasattr(cv2.aruco, facts.fiducials.dictionary):
        raise InputError(
            recording.path, f"names a dictionary {facts.fiducials.dictionary!r} that OpenCV does not have",
            place="pipe.fiducials.dictionary", expected="such as DICT_4X4_100",
        )  # fmt: skip
    numbers = [m.id for m in facts.fiducials.markers]
    twice = sorted({n for n in numbers if numbers.count(n) > 1})
    if twice:
        raise InputError(recording.path, f"lists fiducial {twice[0]} twice", place="pipe.fiducials.markers")
    return gauge_of(facts, facts.fiducials)


def require_fiducials(
    recording: Recording, gauge: Gauge, sightings: Sequence[Sighting], parameters: GaugeParameters
) -> None:
    """Refuse a run in which too few lit frames show fiducials, naming the likely cause."""
    seen = [s for s in sightings if len(s.marker) >= 3]
    if len(seen) >= parameters.least_posed_frames:
        return
    strangers = sorted({int(n) for s in sightings for n in s.strangers})
    problem = (
        f"three or more of the gauge's fiducials are seen in only {len(seen)} of {len(sightings)} lit frames"
    )
    raise UnusableError(
        STAGE, problem + _likely_cause(recording, gauge, strangers),
        limit=f"{parameters.least_posed_frames} frames",
        hint="record a longer run with the wall lit, or correct the fiducials in recording.yaml",
    )  # fmt: skip


def warn_of_overexposed(left_out: int, kept: int, context: Context) -> None:
    """Warn that edges of fiducials are ``left_out`` for being overexposed, beside those ``kept``."""
    if left_out:
        context.warn(
            f"{left_out} of {left_out + kept} edges of fiducials are left out, since the white beside them "
            "is overexposed and seems to reach into the black. What to do: nothing, if σ is small enough; "
            "else expose less, or turn the LEDs down, where the bore is narrow"
        )


def require_poses(
    recording: Recording,
    posed: PosedFrames,
    sightings: Sequence[Sighting],
    gauge: Gauge,
    camera: Camera,
    parameters: GaugeParameters,
) -> None:
    """Refuse fiducials that lie elsewhere than stated, or have another size."""
    looked = sum(len(s.marker) >= 3 for s in sightings)
    if len(posed.index) < max(parameters.least_posed_frames, looked / 2):
        raise UnusableError(
            STAGE,
            f"in {looked - len(posed.index)} of {looked} frames no pose of the camera explains the places of "
            "half of the fiducials: they are mirrored, swapped or placed otherwise than stated",
            limit=f"{parameters.least_posed_frames} frames, and half of those with fiducials",
            hint=f"check columns_along, rows_along and the distance and azimuth of each id; {_PICTURES}",
        )
    ratio, side_px = _size_ratio(posed, gauge, camera)
    tolerance = max(_SIZE_TOLERANCE, _SIDE_ERROR_PX / side_px)
    if ratio < 1 - tolerance and _are_overexposed(recording, posed):
        tolerance = max(tolerance, _OVEREXPOSED_PX / side_px)
    if abs(ratio - 1) > tolerance:
        size = gauge.fiducials.size_mm
        raise UnusableError(
            STAGE, f"the fiducials measure {ratio * size:.2f} mm where recording.yaml says {size:g} mm",
            limit=f"{100 * tolerance:.0f} %",
            hint=f"size_mm is the edge of the black square; {_PICTURES}",
        )  # fmt: skip


def outvoted_fiducials(posed: PosedFrames, gauge: Gauge) -> Int:
    """Return the indices of fiducials that contradict most frames; refuse when there are many."""
    seen, wrong = disagreeing(list(zip(posed.sightings, posed.poses, strict=True)), len(gauge.ids))
    if wrong.sum() > max(_WRONG_SHARE * (seen > 0).sum(), 1):
        raise UnusableError(
            STAGE, f"fiducials {', '.join(map(str, gauge.ids[wrong]))} are not where recording.yaml says",
            limit=f"{100 * _WRONG_SHARE:.0f} % of those seen",
            hint=f"check id, distance and azimuth of each; {_PICTURES}",
        )  # fmt: skip
    return np.flatnonzero(wrong)


def require_bores(gauge: Gauge, section: Int, radius_error_mm: Float) -> None:
    """Refuse rings whose radius, by the stated probe, belongs to another bore."""
    for k, radius in enumerate(gauge.radius_mm):
        here = radius_error_mm[section == k]
        error = float(np.median(here)) if len(here) else 0.0
        if abs(error) > _WRONG_BORE_MM:
            raise UnusableError(
                STAGE,
                f"in section {k + 1} from {gauge.start_mm[k]:g} mm on, the bore measures "
                f"{2 * (radius + error):.1f} mm where recording.yaml says {2 * radius:g} mm",
                limit=f"{2 * _WRONG_BORE_MM:g} mm in diameter",
                hint=f"are the bores listed in the order in which the probe passes them? If so, {_PICTURES}",
            )


def require_rings(frames: int, parameters: GaugeParameters) -> None:
    """Refuse a run with too few rings on known bore."""
    if frames < parameters.least_ring_frames:
        raise UnusableError(
            STAGE, f"only {frames} laser frames show a ring on known bore away from steps and fiducials",
            limit=f"{parameters.least_ring_frames} frames", hint="record a longer run with the laser on",
        )  # fmt: skip


def require_offset(T_pc: Float, parameters: GaugeParameters) -> None:
    """Refuse a camera that stays on the gauge's axis, where tilt and principal point look alike."""
    across = T_pc[:, :2, 3]
    offset = float(np.sqrt(np.mean(np.sum(across**2, 1))))
    if offset < parameters.least_offset_mm:
        raise UnusableError(
            STAGE,
            f"the camera stays within {offset:.2f} mm (r.m.s.) of the gauge's axis: there a tilt of the "
            "sheet and a shift of the principal point cannot be distinguished",
            limit=f"{parameters.least_offset_mm:g} mm",
            hint="move the probe off-centre by several mm to all sides while it passes the bores",
        )


def require_determined(sigma_mm: float, direction: str, parameters: GaugeParameters) -> None:
    """Refuse a result that leaves the radius of the widest bore too uncertain."""
    if sigma_mm > parameters.largest_radius_sigma_mm:
        raise UnusableError(
            STAGE,
            f"the run determines the radius only to 1 σ of {sigma_mm:.3f} mm; the weak direction is "
            f"{direction}",
            limit=f"{parameters.largest_radius_sigma_mm:g} mm",
            hint="record more of the gauge: all bores, off-centre, with roll, and fiducials in view",
        )  # fmt: skip


def _size_ratio(posed: PosedFrames, gauge: Gauge, camera: Camera) -> tuple[float, float]:
    """Return seen over stated size of the fiducials, and the stated side in px: the medians over all."""
    ratios, sides = [], []
    for sighting, pose in zip(posed.sightings, posed.poses, strict=True):
        marker = sighting.marker[pose.fits]
        uv = camera.project(transform(inverse(pose.T_pc), gauge.corners(marker))).uv
        seen, stated = (
            np.linalg.norm(x - np.roll(x, 1, 1), axis=-1).sum(1) for x in (sighting.corner_px[pose.fits], uv)
        )
        ratios.append(seen / stated)
        sides.append(stated / len("nesw"))
    return float(np.nanmedian(np.concatenate(ratios))), float(np.nanmedian(np.concatenate(sides)))


def _are_overexposed(recording: Recording, posed: PosedFrames) -> bool:
    """Return whether the white beside most fiducials of a few frames is clipped."""
    frames, step = recording.frames.frame[posed.index], max(len(posed.index) // LOOKED_AT, 1)
    white, beside = brightest_grey(recording, frames), []
    images = recording.read(frames[::step], "grey")
    for (_, image), sighting in zip(images, posed.sightings[::step], strict=True):
        if image is not None:
            middle = sighting.corner_px.mean(1, keepdims=True)
            at = np.rint(middle + _BESIDE * (sighting.corner_px - middle)).astype(int)
            v, u = (np.clip(at[..., k], 0, image.shape[1 - k] - 1).ravel() for k in (1, 0))
            beside.append(image[v, u])
    return bool(beside) and bool(np.mean(np.concatenate(beside) >= white - BELOW_WHITE_GREY) > 0.5)


def _likely_cause(recording: Recording, gauge: Gauge, strangers: Sequence[int]) -> str:
    """Return the end of a message: mirrored, another dictionary, other numbers, or "" if none fits."""
    lit = recording.frames.of(Illumination.LED, Illumination.BOTH)
    chosen = lit[:: max(len(lit) // LOOKED_AT, 1)]
    images = [image.copy() for _, image in recording.read(chosen, "grey") if image is not None]
    own = detector(gauge.fiducials.dictionary)
    known = set(gauge.ids.tolist())
    mirrored = sum(
        len(known & set(detect(own, np.ascontiguousarray(i[:, ::-1]))[0].tolist())) for i in images
    )
    if mirrored >= max(2 * len(images), 1):
        return "; they are seen after mirroring the pictures: pictures or fiducials are mirrored"
    for name in _OTHERS:
        count = sum(len(detect(detector(name), i)[0]) for i in images)
        if name[:8] != gauge.fiducials.dictionary[:8] and count >= max(3 * len(images), 1):
            return f"; markers of {name} are seen instead of {gauge.fiducials.dictionary}"
    if strangers:
        return f"; markers with other numbers are seen: {', '.join(map(str, strangers[:8]))}"
    return ""
