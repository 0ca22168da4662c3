"""The stated probe with what was found put in, as far as a probe file can say it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pipeline.instrument.probe import Probe
from stages.diagnose.effects.base import Shape

Float = NDArray[np.float64]
Change = Callable[[dict[str, float], Float, Shape], None]


def _tilt(p: dict[str, float], a: Float, shape: Shape) -> None:
    tilt = np.radians(a)
    stretch = np.tan(np.hypot(*tilt)) / max(float(np.hypot(*tilt)), 1e-300)
    p["tilt_x"] += float(tilt[0] * stretch)
    p["tilt_y"] += float(tilt[1] * stretch)


def _cone(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["cone_rad"] += float(np.radians(a[0]))


def _baseline(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["baseline_mm"] += float(a[0])


def _decentre(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["decentre_x_mm"] += float(a[0])
    p["decentre_y_mm"] += float(a[1])


def _waves(p: dict[str, float], a: Float, shape: Shape) -> None:
    for name, value in zip((f"wave{shape[0]:.0f}_cos", f"wave{shape[0]:.0f}_sin"), a, strict=True):
        if name in p:
            p[name] += 1e-3 * float(value)


def _centre(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["cx"] += float(a[0])
    p["cy"] += float(a[1])


def _focal(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["fx"] *= 1 + float(a[0])
    p["fy"] *= 1 + float(a[0])


def _aspect(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["fx"] *= float(np.sqrt(1 + a[0]))
    p["fy"] /= float(np.sqrt(1 + a[0]))


def _radial(p: dict[str, float], a: Float, shape: Shape) -> None:
    p["k1"] += float(a[0])


# Effects that a probe file can express, and how.
CHANGES: Mapping[str, Change] = MappingProxyType({
    "laser_tilt": _tilt, "laser_cone": _cone, "baseline": _baseline, "beam_decentre": _decentre,
    "sheet_waviness": _waves, "principal_point": _centre, "focal_scale": _focal, "pixel_aspect": _aspect,
    "radial_distortion": _radial,
})  # fmt: skip


def corrected(
    probe: Probe,
    instrument: Float,
    effects: Sequence[tuple[str, Float, Shape]],
    covariance: Float,
    source: str,
) -> tuple[Probe, tuple[str, ...]]:
    """Return the probe with the instrument's corrections (P,) and effects put in, and effects it cannot say.

    ``covariance`` (P, P) is of the result's parameters.
    """
    values = dict(zip(probe.parameter_names, probe.parameters + instrument, strict=True))
    unsaid = []
    for name, amplitude, shape in effects:
        change = CHANGES.get(name)
        known = {"fx", "fy", "cx", "cy", "k1"} <= set(values) or name not in _OF_CAMERA
        if change is None or not known:
            unsaid.append(name)
            continue
        change(values, amplitude, shape)
    parameters = np.array([values[n] for n in probe.parameter_names])
    made = probe.with_parameters(parameters, (covariance + covariance.T) / 2)
    return _from(made, source), tuple(unsaid)


_OF_CAMERA = frozenset({"principal_point", "focal_scale", "pixel_aspect", "radial_distortion"})


def _from(probe: Probe, source: str) -> Probe:
    return Probe(
        probe.camera,
        probe.laser,
        probe.covariance,
        probe.shutter,
        probe.lighting,
        probe.encoder_scale_sigma,
        source,
    )
