"""What the twin tells of recordings that the project's own simulator renders with an effect switched on.

``python -m tests.benchmarks.bench_twin_own OUT``: a shipped scene at half its size is rendered once for each
effect, run with withheld frames, and compared: wall, motion and photo are measured in the spoilt pictures, as
a user's would be. ``--nulls N`` renders N scenes in which nothing is switched on, each of another wall, probe
and noise: what is found there is a false alarm. With ``--as-shipped`` nulls keep the scenes' light and gloss:
they clip and shine, which may be told, by ``saturation`` and without a name; any other name is false: their
answers have names of their own. A case that has its answer in OUT is not done again. At last every case is
scored by the answer of another one, too: those counts must collapse.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.api.job import open_job, result_of, run_job
from pipeline.artefacts.twin import Twin
from pipeline.errors import BoresightError
from pipeline.machine.configuration import resolve
from pipeline.machine.display import SilentDisplay
from pipeline.machine.plan import Selection
from pipeline.simulator.build import build_truth
from pipeline.simulator.effects.switch import Switch
from pipeline.simulator.produce import write_recording
from pipeline.simulator.render import renderer_of
from pipeline.simulator.scene import Scene
from stages.catalogue import PIPELINE
from stages.texture import TEXTURE
from stages.twin import PHOTOMETRY, TWIN
from stages.twin.reflectance import LUMA_BGR
from tests.simulated import SCENES, shipped, smaller

_STAGES = (*PIPELINE[: PIPELINE.index(TEXTURE) + 1], PHOTOMETRY, TWIN)
_WITHHOLD, _SHRINK = 4, 2
_NEAR_PX, _NEAR_DEG = 24.0, 20.0
_PEAK, _LEVEL = 0.6, 0.35
"""Of the line and of lit wall: as the scenes have them, speckle and pale wall clip, and walls are glossy."""
_OTHER, _CLOSE = 3, 0.2
"""A case is also scored by the third one's answer after it. Relative error within which a figure tells."""
_NULLS = ("straight-4-inch", "oval-3-inch", "welded-4-inch", "corroded-4-inch", "vibrating-3-inch")


@dataclass(frozen=True)
class Case:
    """An effect that is switched on, and what is right to say of it.

    Attributes
    ----------
    effect : str
    numbers : tuple of float
        Its quantities, in the catalogue's order.
    names : tuple of str
        Names of a mismatch that are right.
    size : float or None
        True value of the mismatch's first parameter.
    place : str
        ``azimuth`` or ``spot``: where the mismatch must lie; empty for what is everywhere.
    figure : tuple of (str, float)
        A figure of noise, lamps or lens that tells it, and its true value: (name, value); or none.
    changes : tuple of (path, value)
        Of the scene, for the effect to show.
    also : tuple of str
        Names that are right beside it and do not tell it.
    """

    effect: str
    numbers: tuple[float, ...]
    names: tuple[str, ...] = ()
    size: float | None = None
    place: str = ""
    figure: tuple[str, float] | None = None
    changes: tuple[tuple[str, Any], ...] = ()
    also: tuple[str, ...] = ()


_OF_COLOUR = float(np.linalg.norm(LUMA_BGR))  # noise of grey over that of each colour
_EXACT = (("codec", "ffv1"),)  # a lossy codec takes fine noise away
_BRIGHT = (("laser.peak", 4.0),)
"""Else a wall throws half a grey level back of the line at most, which rounding takes away."""
_MIRRORS = (("probe.laser.opening_angle_deg", 168.0), ("pipe.relief.roughness_mm", 0.002))
"""A wall mirrors a flat sheet's line onto itself; a cone's, 6° forward, lands 10.7 mm ahead. Rough wall blurs
that over a dozen pixels: what mirrors is smooth."""
CASES = (
    Case("light_flicker", (0.08, 3.7), ("flicker", "laser_flicker")),
    Case("led_dead", (1.0, 60.0), ("led_dead",), 1.0, "azimuth"),
    Case("laser_sector", (0.8, 60.0, 20.0), ("laser_sector",), 0.8, "azimuth"),
    Case("dust", (0.4, 60.0, 4.0), ("window_dirt",), 0.4, "spot"),
    Case("window_scatter", (0.5, -100.0, 6.0), ("window_scatter",), 0.5, "spot"),
    Case("droplet", (1.0, 150.0, 6.0), ("droplet",), None, "spot"),
    Case("saturation", (3.0,), ("saturation",)),
    Case("bloom", (0.3, 6.0), ("bloom",), changes=_BRIGHT, also=("saturation",)),
    Case("gamma", (0.6,), ("response",), figure=("lamp_power", 0.6), changes=_EXACT),
    Case("black_level", (12.0,), figure=("black_dn", 16 + 12 * 219 / 255)),  # of luma in limited range
    Case("defocus", (1.8, 0.0), ("defocus",), figure=("lens_blur_px", math.hypot(0.7, 1.8))),
    Case("defective_pixels", (2e-4, 0.5), ("defective_pixels",), 4e-4, changes=_EXACT),
    Case("read_noise", (60.0,), figure=("read_e", math.hypot(15.0, 60.0) / _OF_COLOUR), changes=_EXACT),
    Case("full_well", (3000.0,), figure=("gain_e_per_dn", 3000 / 255 / _OF_COLOUR**2), changes=_EXACT),
    Case("fixed_pattern", (0.03,), figure=("gain_pattern", 0.03), changes=_EXACT),
    Case("dark_pattern", (0.02,), figure=("dark_pattern_dn", 0.02 * 255), changes=_EXACT),
    Case(
        "interreflection", (1.0,), ("interreflection", "ambient_light"), changes=_BRIGHT, also=("saturation",)
    ),
    Case("ambient_light", (0.2,), ("ambient_light", "interreflection")),
    Case("ghost_ring", (0.1,), ("second_line",), changes=_MIRRORS),
    Case("motion_blur", (0.03,), ("motion_blur",)),
)


def scene_of(name: str, case: Case | None, frames: int, seed: int, dull: bool = True) -> Scene:
    """Return a shipped scene at half its size, with an effect switched on; ``dull`` takes light and gloss."""
    on = () if case is None else (Switch(case.effect, case.numbers),)
    scene = smaller(shipped(name), _SHRINK, frames, seed=seed, probe_seed=seed)
    if not dull:
        return scene
    laser = scene.laser.model_copy(update={"peak": _PEAK})
    surface = scene.pipe.surface.model_copy(update={"gloss": 0.0})
    pipe = scene.pipe.model_copy(update={"surface": surface})
    effects = {s.key: s.numbers for s in on}
    light = scene.light.model_copy(update={"level": _LEVEL})
    scene = scene.model_copy(update={"effects": effects, "laser": laser, "light": light, "pipe": pipe})
    for path, value in case.changes if case else ():
        scene = _changed(scene, path, value)
    return scene


def _changed(part: Any, path: str, value: Any) -> Any:
    """Return a part of a scene with one of its values changed; dots join the names of parts within parts."""
    name, _, inner = path.partition(".")
    if inner:
        value = _changed(part[name] if isinstance(part, dict) else getattr(part, name), inner, value)
    return part | {name: value} if isinstance(part, dict) else part.model_copy(update={name: value})


def answer(scene: Scene, folder: Path) -> dict[str, Any]:
    """Render a scene, run it with withheld frames, and return what its twin tells; nothing else stays."""
    shutil.rmtree(folder, ignore_errors=True)
    start, recording = time.process_time(), folder / "recording"
    renderer = renderer_of(build_truth(scene, SCENES / "scene.yaml"))
    write_recording(renderer, recording, scene.codec, scene.quality, lambda done, total: None)
    configuration = resolve(_STAGES, None, (f"premises.withhold={_WITHHOLD}",))
    job = open_job(recording, folder / "twin", None, _STAGES, (), configuration, "twin")
    run_job(job, Selection(), SilentDisplay())
    twin = result_of(job, Twin)
    shutil.rmtree(folder)
    return {
        "found": [asdict(m) for m in twin.found], "figures": [asdict(f) for f in (*twin.noise, *twin.state)],
        "withdrawn": [m.statement for m in twin.withdrawn], "regions": [asdict(r) for r in twin.regions],
        "frames": len(twin.frame), "seconds": time.process_time() - start,
    }  # fmt: skip


def answers(given: argparse.Namespace) -> Iterator[tuple[str, Case | None, dict[str, Any]]]:
    """Yield name, case and answer of every case and every null; what is there is read."""
    wanted = [(c.effect, _NULLS[0], c, given.seed) for c in CASES if given.only in c.effect]
    kind = "shipped" if given.as_shipped else "null"
    wanted += [(f"{kind}-{k:03d}", _NULLS[k % len(_NULLS)], None, 1000 + k) for k in range(given.nulls)]
    for name, scene, case, seed in wanted:
        file = given.out / f"{name}.json"
        if not file.is_file():
            given.out.mkdir(parents=True, exist_ok=True)
            try:
                dull = case is not None or not given.as_shipped
                made = answer(scene_of(scene, case, given.frames, seed, dull), given.out / name)
            except BoresightError as error:
                made = {"found": [], "figures": [], "refused": str(error), "frames": 0, "seconds": 0.0}
            file.write_text(json.dumps(made, default=float), "utf-8")
        yield name, case, json.loads(file.read_text("utf-8"))


def score(case: Case, told: dict[str, Any], spot: tuple[float, float]) -> Any:
    """Return whether a case is located and named, its size inside 2 σ, sizes told, and false alarms."""
    right = [m for m in told["found"] if _named(case, m)]
    placed = [m for m in told["found"] if _lies_at(case, m, spot) and (case.place or m in right)]
    right = [m for m in right if m in placed]
    sizes = [(p, case.size) for m in right[:1] for p in m["parameters"][:1] if case.size is not None]
    figure = [f for f in told["figures"] if case.figure and f["name"] == case.figure[0]]
    seen = [f for f in figure if case.figure and abs(f["value"] - case.figure[1]) < _CLOSE * case.figure[1]]
    sizes += [(f, case.figure[1]) for f in figure if case.figure and np.isfinite(f["sd"])]
    inside = sum(abs(p["value"] - true) < 2 * p["sd"] for p, true in sizes)
    named = bool(right or seen)
    false = [
        m for m in told["found"] if m not in placed and not _named(case, m) and m["name"] not in case.also
    ]
    return np.array([bool(placed) or bool(seen), named, inside, len(sizes), len(false)], int)


def _named(case: Case, found: dict[str, Any]) -> bool:
    return bool(set(found["name"].split(" or ")) & set(case.names))


def _lies_at(case: Case, found: dict[str, Any], spot: tuple[float, float]) -> bool:
    """Return whether a mismatch lies where its effect was put."""
    at = {p["name"]: p["value"] for p in found["place"]}
    if case.place == "spot":
        if found["fixed_to"] == "line" and "azimuth_deg" in at:  # the spot lies on the line
            return _near_azimuth(case, at)
        here = (at.get("u_px", np.inf), at.get("v_px", np.inf))
        return bool(np.hypot(here[0] - spot[0], here[1] - spot[1]) < _NEAR_PX)
    if case.place == "azimuth":
        return _near_azimuth(case, at)
    return True


def _near_azimuth(case: Case, at: dict[str, float]) -> bool:
    away = abs(at.get("azimuth_deg", np.inf) - case.numbers[1]) % 360
    return bool(min(away, 360 - away) < _NEAR_DEG)


def spot_of(case: Case, given: argparse.Namespace) -> tuple[float, float]:
    """Return the pixel at which a spot was put on the window."""
    if case.place != "spot":
        return (math.nan, math.nan)
    scene = scene_of(_NULLS[0], case, given.frames, given.seed)
    sensor = build_truth(scene, SCENES / "scene.yaml").instrument.sensor
    return (*sensor.dust, *sensor.scatter, *sensor.drops)[0].centre_px


def main(given: argparse.Namespace) -> None:
    """Print what every case shows, and the counts."""
    cases: list[tuple[Case, dict[str, Any], tuple[float, float]]] = []
    nulls: list[bool] = []
    for name, case, told in answers(given):
        print(f"{name}: {told['frames']} frames, {told['seconds']:.0f} s {told.get('refused', '')}")
        for m in told["found"]:
            size = "".join(f" {p['name']} {p['value']:.3g} ± {p['sd']:.2g}" for p in m["parameters"][:1])
            print(f"  [{m['name']}; {m['fixed_to']};{size}] {m['statement']}", flush=True)
        if case is None:
            true = ("", "saturation") if given.as_shipped else ()
            nulls.append(any(m["name"] not in true for m in told["found"]))
            continue
        cases.append((case, told, spot_of(case, given)))
        for f in told["figures"]:
            if case.figure and f["name"] == case.figure[0]:
                print(f"  {f['name']} {f['value']:.4g} ± {f['sd']:.2g}, true {case.figure[1]:.4g}")
        print(f"  {_counts(score(*cases[-1]))}", flush=True)
    right = sum((score(*c) for c in cases), np.zeros(5, int))
    others = [(c, cases[(k + _OTHER) % len(cases)][1], at) for k, (c, _, at) in enumerate(cases)]
    spoilt = sum((score(*c) for c in others), np.zeros(5, int))
    print(f"{len(cases)} cases: {_counts(right)}\nscored by another's answer: {_counts(spoilt)}")
    print(f"alarms in {sum(nulls)} of {len(nulls)} nulls")


def _counts(score: Any) -> str:
    located, named, within, sizes, false = score
    return f"located {located}, named {named}, size within 2 σ {within} of {sizes}, false alarms {false}"


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument("--only", default="", help="effects whose name holds this")
    words.add_argument("--nulls", type=int, default=0)
    words.add_argument("--as-shipped", action="store_true", help="nulls with the scenes' own light and gloss")
    words.add_argument("--frames", type=int, default=120)
    words.add_argument("--seed", type=int, default=401)
    main(words.parse_args())
