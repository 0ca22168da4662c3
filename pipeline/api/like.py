"""Makes a scene from a run: its pipe, path, probe and light, for `boresight simulate --like`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pipeline.api.job import Job, probe_source, result_of, run_job
from pipeline.api.run import Run, open_run
from pipeline.arrays import Float, Float32
from pipeline.artefacts.measured import RingSamples, Trajectory, WallTexture
from pipeline.artefacts.measured import Wall as MeasuredWall
from pipeline.errors import InputError
from pipeline.export.run_record import read_run_record
from pipeline.files.codec import digest
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection, Source
from pipeline.recording.base import Illumination, Recording
from pipeline.recording.checks import CheckedFrames
from pipeline.review.run_files import RunFiles
from pipeline.simulator.build import plain_truth
from pipeline.simulator.render import renderer_of
from pipeline.simulator.scene import Scene, scene_from
from pipeline.simulator.wall import MeasuredPipe, write_measured
from pipeline.simulator.wall.grid import Wall, WallGrid
from stages.texture.surface import wall_surface
from stages.twin import PHOTOMETRY, Photometry
from stages.twin.noise import CameraNoise
from stages.twin.reflectance import LUMA_BGR
from stages.twin.scene import SHADING_MM, SMOOTHING_MM

MEASURED = "measured.npz"
_BEYOND_MM = 250.0
"""Length of photo that is mirrored beyond each end: a camera looks farther ahead than the measured wall."""
_ROUNDS, _LOOKED_AT = 3, 3
"""Iterations that set the lights (several, because clipped light is not linear), and compared frames of each
light."""
_LIT = 10.0
"""Grey levels above black from which a pixel counts as lit."""
_LARGE_WELL_E = 1e9
"""Full well, electrons, of a camera without shot noise: at full scale 3e-5 of the signal remain. Chosen."""
# Grey levels above this are clipped or nearly so.
_CLEAR_OF_WHITE = 250.0
_DEFECT = ("kind", "distance_mm", "azimuth_deg", "length_mm", "width_mm", "depth_mm")


@dataclass(frozen=True)
class Changed:
    """The differences from the run.

    Attributes
    ----------
    speed : float
        Factor on the speed of the probe.
    probe : Path or None
        File of another probe.
    defects : sequence of str
        Defects to add, each ``KIND,DISTANCE,AZIMUTH,LENGTH,WIDTH,DEPTH`` in mm and deg, as in
        ``pit,120,45,6,5,1.2``.
    """

    speed: float = 1.0
    probe: Path | None = None
    defects: Sequence[str] = ()


def scene_like(run: Path, name: str, folder: Path, changed: Changed) -> Scene:
    """Return the scene of a run, and write the measured pipe that it refers to into a folder.

    The photometric state is estimated from frames of the run (`stages.twin`); the lights are set so that
    rendered frames are as bright as the recorded ones.

    Raises
    ------
    InputError
        When the run, its recording, the probe or a defect cannot be used.
    UnusableError
        When the run's wall or frames do not contain enough information.
    """
    record, opened, files = read_run_record(run), open_run(run), RunFiles(run)
    recording = opened.recording()
    frames = files.artefact(CheckedFrames)
    folder.mkdir(parents=True, exist_ok=True)
    write_measured(_measured(opened, frames), folder / MEASURED)
    light = _photometry(opened, frames, recording, folder / "photometry")
    values = _values(opened, recording, frames, record.probe, name)
    values |= _seen_light(light, *_grey_of_colour(recording, frames))
    scene = _with_lights(scene_from(values, run), folder / "scene.yaml", recording)
    return change(scene, changed)


def _values(run: Run, recording: Recording, frames: CheckedFrames, probe: Path, name: str) -> dict[str, Any]:
    """Return the values of the scene without lights and sensor."""
    radius = float(np.nanmean(run.wall.radius_map.radius_mm))
    return {
        "name": name,
        "summary": f"made from the run {run.path.name} of {recording.name}",
        "frames": len(run.trajectory.frame),
        "frame_rate": recording.frame_rate,
        "pattern": frames.illumination[np.isin(frames.frame, run.trajectory.frame)].tolist(),
        "probe": dict(read_yaml(probe).values),
        "truth": "stated",
        "pipe": {
            "diameter_mm": 2 * radius,
            "nominal_diameter_mm": recording.pipe.nominal_diameter_mm,
            "measured": MEASURED,
            "relief": {"roughness_mm": 0.0},
            "surface": {"gloss": 0.0},
        },
        "motion": {"measured": MEASURED},
    }


def _measured(run: Run, frames: CheckedFrames) -> MeasuredPipe:
    trajectory = run.trajectory
    time_s = frames.time_s[np.isin(frames.frame, trajectory.frame)]
    return MeasuredPipe(_wall(run.wall, run.texture), time_s - time_s[0], trajectory.T_pc)


def _wall(measured: MeasuredWall, photo: WallTexture) -> Wall:
    """Return the measured wall with its gaps filled; beyond its ends the photo is mirrored."""
    surface = wall_surface(measured, SMOOTHING_MM, SHADING_MM)
    # The simulator's columns lie half a cell farther on.
    radius = (surface.radius_mm + np.roll(surface.radius_mm, -1, axis=1)) / 2
    step = float(surface.distance_mm[1] - surface.distance_mm[0])
    shape = WallGrid(float(surface.distance_mm[0]), step, *radius.shape)
    more = min(round(_BEYOND_MM / photo.mm_per_px), len(photo.bgra) - 1)
    columns = round(2 * math.pi / photo.rad_per_px)
    at = (
        -math.pi + (np.arange(columns) + 0.5) * photo.rad_per_px - photo.azimuth_from_rad
    ) / photo.rad_per_px
    albedo = np.pad(
        photo_as_reflectance(photo)[:, np.round(at).astype(int) % columns],
        ((more, more), (0, 0), (0, 0)),
        "reflect",
    )
    first = photo.distance_from_mm - more * photo.mm_per_px
    texture = WallGrid(first, photo.mm_per_px, *albedo.shape[:2])
    return Wall(surface.axis, shape, radius.astype(np.float32), texture, albedo)


def photo_as_reflectance(photo: WallTexture) -> Float32:
    """Return the photo (H, W, 3) as reflectance from 0 to 1; unseen wall gets the mean around it."""
    known = (photo.bgra[..., 3] > 0).astype(np.float32)
    colour = photo.bgra[..., :3].astype(np.float32) / 255
    if known.all():
        return np.asarray(colour, np.float32)
    mean = colour[known > 0].mean(0)
    wide = cv2.GaussianBlur(colour * known[..., None], (0, 0), 15)
    share = cv2.GaussianBlur(known, (0, 0), 15)[..., None]
    # Below a hundredth of the weight, 8-bit steps of the photo are magnified: the mean is better.
    about = np.where(share > 0.01, wide / np.maximum(share, 0.01), mean)
    return np.where(known[..., None] > 0, colour, about).astype(np.float32)


def _photometry(run: Run, frames: CheckedFrames, recording: Recording, folder: Path) -> Photometry:
    """Return the photometric state, computed by the runner."""
    parts: tuple[tuple[type, object], ...] = (
        (CheckedFrames, frames), (RingSamples, run.rings), (Trajectory, run.trajectory),
        (MeasuredWall, run.wall), (WallTexture, run.texture),
    )  # fmt: skip
    key = RunFiles(run.path).version
    sources = [Source(kind, value, digest((kind.__name__, key))) for kind, value in parts]
    sources += [Source(Recording, recording, recording.content_key), probe_source(run.probe())]
    stages = (PHOTOMETRY,)
    job = Job("simulate", tuple(sources), stages, (), resolve(stages, None, ()), folder)
    run_job(job, Selection(), SilentDisplay())
    return result_of(job, Photometry)


def _grey_of_colour(recording: Recording, frames: CheckedFrames) -> tuple[float, float]:
    """Return offset and slope of grey levels over the luma of B, G, R: a video's range may change both."""
    chosen = frames.frame[np.linspace(0, len(frames.frame) - 1, _LOOKED_AT).astype(int)]
    grey, colour = (
        [image.astype(float) for _, image in recording.read(chosen, form) if image is not None]
        for form in ("grey", "bgr")
    )
    luma = np.stack([image @ LUMA_BGR for image in colour]).ravel()
    use = (luma > 0) & (luma < _CLEAR_OF_WHITE)
    if not use.any() or float(np.ptp(luma[use])) < _LIT:
        return 0.0, 1.0
    slope, offset = np.polyfit(luma[use], np.stack(grey).ravel()[use], 1)
    return float(offset), float(slope)


def _seen_light(found: Photometry, offset: float, slope: float) -> dict[str, Any]:
    """Return lights and sensor of the photometric state, as entries of a scene.

    ``offset`` and ``slope`` convert the luma of a rendered colour picture to the grey levels of the state.
    """
    state = found.state
    noise, line, lamp = state.noise, state.line, state.lamp
    sensor: dict[str, float] = {"black_level": max((noise.black.value - offset) / slope, 0.0)}
    sensor |= _sensor_noise(noise, slope)
    values: dict[str, Any] = {"sensor": sensor}
    if line is not None:
        # A pixel alone blurs by 1/√12 px; the simulator's samples do that themselves.
        sensor["psf_sigma_px"] = math.sqrt(max(line.blur_px.value**2 - 1 / 12, 0.09))
        values["laser"] = {"speckle": float(np.clip(line.speckle.value, 0, 0.5))}
    if lamp is not None:
        cosine = np.cos(np.minimum(lamp.theta_rad, math.radians(85)))
        weight = 1 / np.maximum(lamp.falloff_sd, 1e-3)
        lobe = float(np.polyfit(np.log(cosine), lamp.log_falloff, 1, w=weight)[0])
        values["light"] = {"lobe": float(np.clip(lobe, 0, 20)), "even": 0.0}
    return values


def _sensor_noise(noise: CameraNoise, slope: float) -> dict[str, float]:
    """Return the noise of a sensor whose grey has the recorded noise; empty if that is unknown.

    Noise is drawn for each colour, and grey, the weighted sum of all, has less of it. A camera without shot
    noise gets a very large full well.
    """
    less, read = float(np.linalg.norm(LUMA_BGR)), noise.read_variance.value - 1 / 12
    if read <= 0 and math.isinf(noise.variance_per_level.sd):
        return {}
    well = 255 * slope * less**2 * noise.electrons_per_level.value
    well = max(well, 20.0) if math.isfinite(well) else _LARGE_WELL_E
    return {"full_well_e": well, "read_noise_e": math.sqrt(max(read, 0.0)) / (255 * slope * less) * well}


def _with_lights(scene: Scene, file: Path, recording: Recording) -> Scene:
    """Return the scene with laser and LEDs set so that frames are as bright as the recorded ones."""
    light = np.array([scene.pattern[k % len(scene.pattern)] for k in range(scene.frames)])
    for _ in range(_ROUNDS):
        renderer = renderer_of(plain_truth(scene, file))
        for kind, part, field in (
            (Illumination.LASER, "laser", "peak"),
            (Illumination.LED, "light", "level"),
        ):
            number = np.flatnonzero(light == kind.value)
            if not len(number):
                continue
            chosen = number[(np.linspace(0.3, 0.7, _LOOKED_AT) * len(number)).astype(int)]
            read = recording.read(chosen, "bgr")
            recorded = [image @ LUMA_BGR for _, image in read if image is not None]
            rendered = [renderer.frame(int(n)) @ LUMA_BGR for n in chosen]
            ratio = _ratio(recorded, rendered, scene.sensor.black_level)
            old = getattr(scene, part)
            new = old.model_copy(update={field: float(np.clip(getattr(old, field) * ratio, 1e-3, 50))})
            scene = scene.model_copy(update={part: new})
    return scene


def _ratio(recorded: Sequence[Float], rendered: Sequence[Float], black: float) -> float:
    """Return the ratio of recorded to rendered brightness where both are lit."""
    above = [np.stack(recorded) - black, np.stack(rendered) - black]
    use = (above[0] > _LIT) & (above[1] > _LIT)
    if not use.any():
        return 1.0
    return float(above[0][use].sum(dtype=float) / above[1][use].sum(dtype=float))


def change(scene: Scene, changed: Changed) -> Scene:
    """Return the scene with another speed, probe and further defects."""
    motion = scene.motion.model_copy(update={"speed": changed.speed})
    defects = [_defect(text) for text in changed.defects]
    pipe = type(scene.pipe).model_validate(scene.pipe.model_dump() | {"defects": tuple(defects)})
    frames = max(int((scene.frames - 1) / changed.speed) + 1, 2)
    update: dict[str, Any] = {"motion": motion, "pipe": pipe, "frames": frames}
    if changed.probe is not None:
        update["probe"] = dict(read_yaml(changed.probe).values)
    return scene.model_copy(update=update)


def _defect(text: str) -> dict[str, Any]:
    words = [w.strip() for w in text.split(",")]
    try:
        numbers = [float(w) for w in words[1:]]
        return dict(zip(_DEFECT, (words[0], *numbers), strict=True))
    except ValueError as error:
        raise InputError(
            "--defect",
            f"{text!r} is not a defect",
            expected="KIND,DISTANCE,AZIMUTH,LENGTH,WIDTH,DEPTH",
            hint="write KIND,DISTANCE,AZIMUTH,LENGTH,WIDTH,DEPTH in mm and deg, such as pit,120,45,6,5,1.2",
        ) from error
