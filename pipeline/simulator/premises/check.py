"""Single checks of pictures and sampling, and the complete checks of a scene and of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from pipeline.arrays import Bool, Float, Image
from pipeline.recording.base import Illumination
from pipeline.recording.folder import open_folder
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.premises import Premise, effect_premises, require
from pipeline.simulator.render import Renderer
from pipeline.simulator.truth import SceneTruth

# A Gaussian of 0.5 steps 1 σ, summed at steps, moves by 0.002 steps at most.
_LEAST_STEPS = 0.5
# Step of the derivative, mm: 0.02 mm moves the line by far more than rounding and by far less than its
# curvature.
_LITTLE_MM = 0.01


def line_premise(truth: SceneTruth) -> Premise:
    """Return how wide the line is, 1 σ in steps of its rendering, on the widest wall and before blur.

    A narrower line falls between the samples of a pixel and jumps with them.
    """
    per_step = line_px_per_mm(truth) * truth.rendering.line_samples
    return Premise(
        "width of the line in steps of its rendering", truth.instrument.laser.profile.sigma_mm * per_step,
        _LEAST_STEPS, hint="raise rendering.line_samples, or probe.laser.line_sigma_mm",
    )  # fmt: skip


def line_px_per_mm(truth: SceneTruth) -> float:
    """Return pixels of image radius per mm of height of the sheet, on the widest wall."""
    camera, height = truth.instrument.camera.model, truth.instrument.laser.sheet.baseline_mm
    radius = float(truth.wall.radius_mm.max())
    rays = np.array([[radius, 0.0, height - _LITTLE_MM], [radius, 0.0, height + _LITTLE_MM]])
    uv = camera.project(rays).uv
    return float(np.linalg.norm(uv[1] - uv[0]) / (2 * _LITTLE_MM))


# Grey level at which a line counts as seen, and share of azimuths that must show it. Chosen, not measured.
_LEAST_PEAK, _LEAST_SHARE = 25.0, 0.85
# Largest shares of line and lit wall that may clip. Chosen, not measured.
_MOST_CLIPPED_LINE, _MOST_CLIPPED_WALL = 0.9, 0.05
# Least median grey and least texture contrast of the lit wall, grey levels. Chosen, not measured.
_LEAST_WALL, _LEAST_TEXTURE = 8.0, 1.0
# A pose needs three markers; share of lit frames that must show them. The share is chosen, not measured.
_LEAST_MARKERS, _LEAST_FRAMES_WITH = 3, 0.3
# Grey level from which a pixel counts as clipped: the codec may move 255 by one.
_CLIPPED = 254
# Number of directions, and the size, px, below which contrast counts as texture.
_AZIMUTHS, _TEXTURE_PX = 360, 8
# beyond the picture's edge is black, and not uninitialised memory
_POLAR = cv2.INTER_LINEAR | cv2.WARP_FILL_OUTLIERS
# Frames of each illumination that are examined: a few seconds of rendering before that of the whole.
_LED_LOOKED_AT, _LASER_LOOKED_AT = 6, 4


def chosen_frames(truth: SceneTruth) -> tuple[int, ...]:
    """Return the frames to examine: a few of each illumination, spread over the run."""
    numbers: set[int] = set()
    for kind in Illumination:
        frames = truth.frames.of(kind)
        many = _LASER_LOOKED_AT if kind is Illumination.LASER else _LED_LOOKED_AT
        spread = (np.arange(min(many, len(frames))) + 0.5) / many * len(frames)
        numbers |= set(frames[spread.astype(int)].tolist())
    return tuple(sorted(numbers))


def picture_premises(truth: SceneTruth, pictures: Mapping[int, Image]) -> list[Premise]:
    """Return what must hold of frames (H, W, 3) BGR by their number."""
    kind = {n: str(truth.frames.illumination[n]) for n in pictures}
    laser = {n: p for n, p in pictures.items() if kind[n] == Illumination.LASER}
    lit = {n: p for n, p in pictures.items() if kind[n] != Illumination.LASER}
    found = _laser_premises(truth, laser) if laser else []
    found += _lit_premises(truth, lit) if lit else []
    if truth.facts.fiducials is not None and lit:
        found.append(_fiducial_premise(truth, lit))
    return found


def _laser_premises(truth: SceneTruth, pictures: Mapping[int, Image]) -> list[Premise]:
    peaks = np.array([_peaks(truth, p) for p in pictures.values()])
    frames = tuple(pictures)
    return [
        Premise(
            "azimuths at which the line is seen", float((peaks >= _LEAST_PEAK).mean()), _LEAST_SHARE,
            frames=frames, hint="raise laser.peak, or keep the probe nearer to the axis",
        ),
        Premise(
            "azimuths at which the line clips", float((peaks >= _CLIPPED).mean()), _MOST_CLIPPED_LINE,
            at_most=True, frames=frames, hint="lower laser.peak",
        ),
    ]  # fmt: skip


def _lit_premises(truth: SceneTruth, pictures: Mapping[int, Image]) -> list[Premise]:
    ring = _annulus(truth)
    walls = [p[..., 1][ring] for p in pictures.values()]
    contrast = [_texture(p, ring) for p in pictures.values()]
    frames = tuple(pictures)
    return [
        Premise(
            "median grey of the lit wall", float(np.median([np.median(w) for w in walls])), _LEAST_WALL,
            "of 255", frames=frames, hint="raise light.level",
        ),
        Premise(
            "share of the lit wall that clips", float(np.mean([(w >= _CLIPPED).mean() for w in walls])),
            _MOST_CLIPPED_WALL, at_most=True, frames=frames, hint="lower light.level",
        ),
        Premise(
            "contrast of the wall's fine texture", float(np.median(contrast)),
            _LEAST_TEXTURE, "of 255", frames=frames, hint="raise pipe.surface.grain or mottle",
        ),
    ]  # fmt: skip


def _fiducial_premise(truth: SceneTruth, pictures: Mapping[int, Image]) -> Premise:
    fiducials = truth.facts.fiducials
    assert fiducials is not None
    known = {m.id for m in fiducials.markers}
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, fiducials.dictionary))
    detector = cv2.aruco.ArucoDetector(dictionary)
    counts = []
    for picture in pictures.values():
        _, ids, _ = detector.detectMarkers(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
        counts.append(0 if ids is None else len(known & set(ids.ravel().tolist())))
    share = float(np.mean([n >= _LEAST_MARKERS for n in counts]))
    return Premise(
        f"lit frames in which {_LEAST_MARKERS} fiducials decode", share, _LEAST_FRAMES_WITH,
        frames=tuple(pictures), hint="larger fiducials, more light, or a way that begins before the gauge",
    )  # fmt: skip


def _peaks(truth: SceneTruth, picture: Image) -> Float:
    """Return the brightest grey along each of 360 directions from the stated centre."""
    camera = truth.stated.camera
    centre = camera.project(np.array([0.0, 0.0, 1.0])).uv
    size = (int(np.hypot(*camera.image_size) / 2), _AZIMUTHS)
    polar = cv2.warpPolar(picture, size, tuple(map(float, centre)), size[0], _POLAR)
    return np.asarray(polar.max((1, 2)), float)


def _annulus(truth: SceneTruth) -> Bool:
    """Return the pixels (H, W) that see the wall near the laser's ring, by the stated probe."""
    camera = truth.stated.camera
    ring = np.arctan2(truth.facts.nominal_diameter_mm / 2, truth.stated.laser.baseline_mm)
    rays = np.array([[np.sin(a), 0.0, np.cos(a)] for a in (0.6 * ring, 1.1 * ring)])
    centre = camera.project(np.array([0.0, 0.0, 1.0])).uv
    inner, outer = np.linalg.norm(camera.project(rays).uv - centre, axis=1)
    v, u = np.mgrid[: camera.image_size[1], : camera.image_size[0]]
    away = np.hypot(u - centre[0], v - centre[1])
    return np.asarray((away >= inner) & (away <= outer))


def _texture(picture: Image, ring: Bool) -> float:
    grey = picture[..., 1].astype(np.float32)
    fine = grey - cv2.blur(grey, (_TEXTURE_PX, _TEXTURE_PX))
    return float(fine[ring].std())


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
