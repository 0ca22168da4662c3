"""What the twin finds in recordings that the project's own simulator renders with an effect switched on.

``python -m tests.benchmarks.bench_twin_own OUT``: a shipped scene at half its size is rendered once for each
effect, of a drawn size, run with withheld frames, and compared. Wall, motion and photo are measured in the
affected pictures, as a user's would be. ``--nulls N`` renders N scenes without an effect, each with another
wall, probe and noise: what is found there is a false alarm. With ``--as-shipped`` these nulls keep the
scenes' light and gloss: they clip and shine, which may be reported, as ``saturation`` and as a mismatch
without a name; any other name is false. Their answers are stored under names of their own. A case that has
its answer in OUT is not done again. Finally every case is also scored by the answer to another effect: those
counts must be bad. With a single effect there is no such answer. Nulls are scored by the answers to effects.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
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
from tests.benchmarks.twin_cases import CASES, Case
from tests.simulated import SCENES, shipped, smaller

_STAGES = (*PIPELINE[: PIPELINE.index(TEXTURE) + 1], PHOTOMETRY, TWIN)
_WITHHOLD, _SHRINK = 4, 2
_NEAR_PX, _NEAR_DEG = 24.0, 20.0
_PEAK, _LEVEL = 0.6, 0.35
"""Power of the line and of lit light.

At the scenes' own values, speckle and pale wall clip, and walls are glossy.
"""
_OTHER, _CLOSE = 3, 0.2
"""A case is also scored by the answer to the third other effect after it.

The other number is the relative error within which a figure counts as right.
"""
_NULLS = ("straight-4-inch", "oval-3-inch", "welded-4-inch", "corroded-4-inch", "vibrating-3-inch")


def scene_of(name: str, case: Case | None, frames: int, seed: int, dull: bool = True) -> Scene:
    """Return a shipped scene at half its size, with an effect switched on.

    ``dull`` reduces light and gloss.
    """
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
    """Return a part of a scene with one of its values changed; dots join the names of nested parts."""
    name, _, inner = path.partition(".")
    if inner:
        value = _changed(part[name] if isinstance(part, dict) else getattr(part, name), inner, value)
    return part | {name: value} if isinstance(part, dict) else part.model_copy(update={name: value})


def answer(scene: Scene, folder: Path) -> dict[str, Any]:
    """Render a scene, run it with withheld frames, and return the result of its twin.

    Nothing else is kept.
    """
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
    """Yield name, case and answer of every case and every null; stored answers are read."""
    chosen = [c for c in CASES if any(o in c.effect for o in given.only.split("+"))]
    drawn = [c.drawn(given.seed + k) for k in range(given.draws) for c in chosen]
    wanted: list[tuple[str, str, Case | None, int]] = [
        (f"{c.effect}-{c.seed}", _NULLS[0], c, c.seed) for c in drawn
    ]
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
    """Return whether a case is located, whether named, sizes within 2 σ, all sizes, and false alarms."""
    right = [m for m in told["found"] if _named(case, m)]
    placed = [m for m in told["found"] if _lies_at(case, m, spot) and (case.place or m in right)]
    right = [m for m in right if m in placed]
    true = case.true_figure
    sizes = [(p, case.size_as(m)) for m in right[:1] for p in m["parameters"][:1] if case.size is not None]
    figure = [(f, true) for f in told["figures"] if case.figure and true and f["name"] == case.figure[0]]
    seen = [f for f, is_ in figure if abs(f["value"] - is_) < _CLOSE * is_]
    sizes += [(f, is_) for f, is_ in figure if np.isfinite(f["sd"])]
    inside = sum(abs(p["value"] - is_) < 2 * p["sd"] for p, is_ in sizes)
    named = bool(right or seen)
    false = [
        m for m in told["found"] if m not in placed and not _named(case, m) and m["name"] not in case.also
    ]
    return np.array([bool(placed) or bool(seen), named, inside, len(sizes), len(false)], int)


def _named(case: Case, found: dict[str, Any]) -> bool:
    return bool(set(found["name"].split(" or ")) & set(case.names))


def _lies_at(case: Case, found: dict[str, Any], spot: tuple[float, float]) -> bool:
    """Return whether a mismatch lies where its effect was added."""
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
    scene = scene_of(_NULLS[0], case, given.frames, case.seed)
    sensor = build_truth(scene, SCENES / "scene.yaml").instrument.sensor
    return (*sensor.dust, *sensor.scatter, *sensor.drops)[0].centre_px


def main(given: argparse.Namespace) -> None:
    """Print the result of every case, and the counts."""
    cases: list[tuple[Case, dict[str, Any], tuple[float, float]]] = []
    nulls: list[bool] = []
    true = ("", "saturation") if given.as_shipped else ()
    for name, case, told in answers(given):
        put = "" if case is None else " ".join(f"{n:.3g}" for n in case.numbers)
        print(f"{name} {put}: {told['frames']} frames, {told['seconds']:.0f} s {told.get('refused', '')}")
        for m in told["found"]:
            size = "".join(f" {p['name']} {p['value']:.3g} ± {p['sd']:.2g}" for p in m["parameters"][:1])
            print(f"  [{m['name']}; {m['fixed_to']};{size}] {m['statement']}", flush=True)
        if case is None:
            nulls.append(any(m["name"] not in true for m in told["found"]))
            continue
        cases.append((case, told, spot_of(case, given)))
        for f in told["figures"]:
            if case.figure and f["name"] == case.figure[0]:
                print(f"  {f['name']} {f['value']:.4g} ± {f['sd']:.2g}, true {case.true_figure:.4g}")
        print(f"  {_counts(score(*cases[-1]))}", flush=True)
    right = sum((score(*c) for c in cases), np.zeros(5, int))
    spoilt = sum((score(*c) for c in exchanged(cases)), np.zeros(5, int))
    print(f"{len(cases)} cases: {_counts(right)}")
    print(f"{len(exchanged(cases))} cases scored by the answer to another effect: {_counts(spoilt)}")
    print(f"alarms in {sum(nulls)} of {len(nulls)} nulls")
    alarms = sum(any(m["name"] not in true for m in told["found"]) for _, told, _ in cases)
    print(f"alarms in {alarms} of {len(cases)} nulls, scored by the answers to effects")


Answered = tuple[Case, dict[str, Any], tuple[float, float]]


def exchanged(cases: Sequence[Answered]) -> list[Answered]:
    """Return cases, each with the answer to another effect; one for which there is none is left out."""
    out = []
    for k, (case, _, at) in enumerate(cases):
        after = [*cases[k + 1 :], *cases[:k]]
        others = [told for c, told, _ in after if c.effect != case.effect]
        if others:
            out.append((case, others[(_OTHER - 1) % len(others)], at))
    return out


def _counts(score: Any) -> str:
    located, named, within, sizes, false = score
    return f"located {located}, named {named}, size within 2 σ {within} of {sizes}, false alarms {false}"


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument(
        "--only", default="", help="effects whose name holds this, or one of these, joined by +"
    )
    words.add_argument("--draws", type=int, default=1, help="cases of each effect, with seeds from --seed on")
    words.add_argument("--nulls", type=int, default=0)
    words.add_argument("--as-shipped", action="store_true", help="nulls with the scenes' own light and gloss")
    words.add_argument("--frames", type=int, default=120)
    words.add_argument("--seed", type=int, default=401)
    main(words.parse_args())
