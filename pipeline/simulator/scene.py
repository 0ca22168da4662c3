"""A scene file: the instrument, the pipe, the motion, the lights and the sensor of a recording to render."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal, Self

import yaml
from pydantic import Field, ValidationError, model_validator

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.stage import Parameters
from pipeline.simulator.wall.description import Pipe

Bgr = tuple[float, float, float]
Pattern = Literal["laser", "led", "both"]


class LaserScene(Parameters):
    """Light of the laser."""

    peak: float = Field(0.9, gt=0, le=50, description="line's mean peak over full scale before blur")
    colour_bgr: Bgr = Field((0.35, 1.0, 0.15), description="share of each channel")
    skewness: float = Field(0.0, ge=-1.9, le=1.9, description="skewness of the sheet's own profile")
    ghost: float = Field(
        0.0, ge=0, le=1, description="share of the line that the wall mirrors across the bore"
    )
    speckle: float = Field(0.1, ge=0, le=1, description="speckle contrast")
    speckle_grain_mm: float = Field(0.05, gt=0, le=2, description="size of a speckle on the wall, mm")


class LightScene(Parameters):
    """Light of the LEDs.

    A bare LED is a Lambertian emitter, cos θ: ``lobe`` 1. A lens over it narrows that: 1.5 to 5. What the
    bore throws back and forth until it is about even, a few tenths of the direct light on a pale wall, is not
    traced: ``even`` stands for it.
    """

    level: float = Field(
        0.6, gt=0, le=50, description="light of the mean wall where it is brightest, over full scale"
    )
    lobe: float = Field(1.0, ge=0, le=20, description="exponent of the emission cos^m; 1: bare LED")
    even: float = Field(0.15, ge=0, le=1, description="share emitted evenly forward, for bounced light")
    colour_bgr: Bgr = Field((1.0, 1.0, 1.0), description="share of each channel")


class SensorScene(Parameters):
    """From light to grey levels."""

    full_well_e: float = Field(10000.0, gt=10, description="electrons at which a pixel clips")
    read_noise_e: float = Field(15.0, ge=0, description="read noise, 1 σ, electrons")
    black_level: float = Field(0.0, ge=0, le=100, description="grey level without light")
    gamma: float = Field(1.0, ge=0.2, le=3, description="grey = light to this power")
    psf_sigma_px: float = Field(0.7, ge=0, le=10, description="1 σ of the lens' blur, px")
    veil: float = Field(0.0, ge=0, le=0.5, description="share of the light spread by glare")
    veil_sigma_px: float = Field(60.0, gt=1, le=1000, description="1 σ of that spread, px")
    vignetting: float = Field(0.0, ge=0, le=10, description="exponent k of the fall-off cos^k θ")
    fixed_pattern: float = Field(0.0, ge=0, le=0.5, description="1 σ of the pixels' gain")


class WaveScene(Parameters):
    """One sinusoid of a motion."""

    amplitude: float = Field(description="amplitude, in the unit of the value that moves")
    period_s: float = Field(gt=0, description="period, s")
    phase_deg: float = Field(0.0, description="phase, deg")


class SwayScene(Parameters):
    """A value that sways about a mean."""

    mean: float = Field(0.0, description="mean value")
    trend_per_s: float = Field(0.0, description="constant rate of change, per s")
    waves: tuple[WaveScene, ...] = Field((), description="sinusoids added")


class LegScene(Parameters):
    """A stretch of the drive at one speed; a stop has speed 0."""

    duration_s: float = Field(gt=0, description="duration, s")
    speed_mm_s: float = Field(description="mm/s, backward negative")


class MotionScene(Parameters):
    """The camera's motion: legs along the axis at given speeds, joined smoothly, and its sway."""

    start_mm: float = Field(0.0, description="distance at the first frame")
    legs: tuple[LegScene, ...] = Field((), description="legs in order; none with a measured route")
    measured: str | None = Field(
        None, description="way of a run (NPZ of simulate --like), relative to the scene's folder"
    )
    speed: float = Field(1.0, gt=0, le=100, description="factor on the speed of a measured route")
    easing_s: float = Field(0.2, gt=0, le=10, description="duration of the transition between two speeds, s")
    x_mm: SwayScene = Field(default_factory=lambda: SwayScene.model_validate({}))
    y_mm: SwayScene = Field(default_factory=lambda: SwayScene.model_validate({}))
    yaw_deg: SwayScene = Field(default_factory=lambda: SwayScene.model_validate({}))
    pitch_deg: SwayScene = Field(default_factory=lambda: SwayScene.model_validate({}))
    roll_deg: SwayScene = Field(default_factory=lambda: SwayScene.model_validate({}))

    @model_validator(mode="after")
    def _require_one_way(self) -> Self:
        if bool(self.legs) == bool(self.measured):
            raise ValueError("give either legs or a measured way")
        return self


class OdometerScene(Parameters):
    """The encoder."""

    rate_hz: float = Field(100.0, gt=0.1, le=1e5, description="readings a second")
    quantum_mm: float = Field(0.05, ge=0, le=100, description="step of its counter")
    scale: float = Field(0.0, ge=-0.2, le=0.2, description="reading over true distance, less one")


class Rendering(Parameters):
    """How finely a frame is computed."""

    line_samples: int = Field(3, ge=1, le=16, description="samples along a pixel's side where the line is")
    wall_samples: int = Field(1, ge=1, le=8, description="samples along a pixel's side elsewhere")
    time_samples: int = Field(1, ge=1, le=64, description="moments within an exposure")


class Scene(Parameters):
    """Everything that a rendered recording depends on."""

    name: str = Field(min_length=1, description="name of the recording")
    summary: str = Field("", description="purpose in one sentence")
    kind: Literal["inspection", "gauge"] = Field("inspection", description="kind of run")
    seed: int = Field(0, ge=0, description="seed of all random values")
    probe_seed: int | None = Field(
        None, ge=0, description="seed of the true instrument's draw; absent: as seed"
    )
    frames: int = Field(gt=0, le=1_000_000, description="number of frames")
    frame_rate: float = Field(30.0, gt=0, le=10_000, description="frames per second")
    pattern: tuple[Pattern, ...] = Field(("laser", "led"), min_length=1, description="illumination, repeated")
    probe: dict[str, Any] = Field(description="stated parameters of the instrument, as in probe.yaml")
    truth: Literal["stated", "drawn"] = Field(
        "drawn", description="true instrument: as stated, or drawn from its stated uncertainty"
    )
    laser: LaserScene = Field(default_factory=lambda: LaserScene.model_validate({}))
    light: LightScene = Field(default_factory=lambda: LightScene.model_validate({}))
    sensor: SensorScene = Field(default_factory=lambda: SensorScene.model_validate({}))
    pipe: Pipe
    motion: MotionScene
    odometer: OdometerScene | None = Field(default_factory=lambda: OdometerScene.model_validate({}))
    effects: dict[str, dict[str, float] | None] = Field(
        default_factory=dict, description="effects that are switched on"
    )
    rendering: Rendering = Field(default_factory=lambda: Rendering.model_validate({}))
    codec: Literal["h264", "ffv1", "png"] = Field("h264", description="how frames are stored")
    quality: int = Field(14, ge=0, le=51, description="constant rate factor of H.264")


def read_scene(file: Path) -> Scene:
    """Read a scene file.

    Raises
    ------
    InputError
        At the key that is unknown, missing, mistyped or out of range.
    """
    return scene_from(dict(read_yaml(file).values), file)


def scene_from(values: dict[str, Any], file: Path) -> Scene:
    """Return the scene of a mapping; ``file`` is named in errors. See `read_scene`."""
    try:
        return Scene.model_validate_json(json.dumps(values))
    except TypeError as error:
        raise InputError(file, f"is not a valid scene: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(file, f"{place}: {first['msg']}", place=f"key {place}") from error


def write_scene(scene: Scene, file: Path) -> None:
    """Write a scene that `read_scene` reads back."""
    values = scene.model_dump(mode="json", exclude_defaults=True)
    file.write_text(yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=100), "utf-8")
