"""Every shipped scene rendered, run and compared with its truth.

``python -m tests.benchmarks.bench_scenes [--frames N] [--shrink K] [SCENE ...]``. In full, the scenes take
about an hour of two cores; ``--shrink 2 --frames 120`` gives a quick look at all of them.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import traceback
from pathlib import Path

from pipeline.errors import Cancelled
from pipeline.simulator.scene import Scene
from tests.scene_runs import SceneScore, run_scene
from tests.simulated import SCENES, shipped, smaller

_HEAD = (
    "scene              frames   bias mm  median mm    rms mm  stated σ  inside   seen distance   1 σ  CPU"
)


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("scenes", nargs="*", default=sorted(f.stem for f in SCENES.glob("*.yaml")))
    words.add_argument("--frames", type=int, default=1_000_000)
    words.add_argument("--shrink", type=int, default=1)
    words.add_argument("--keep", type=Path, help="folder to keep recordings, truths and runs in")
    given = words.parse_args()
    print(_HEAD)
    with tempfile.TemporaryDirectory() as temporary:
        for name in given.scenes:
            _one(_sized(shipped(name), given.shrink, given.frames), given.keep or Path(temporary))


def _sized(scene: Scene, shrink: int, most: int) -> Scene:
    frames = min(scene.frames, most)
    return scene.model_copy(update={"frames": frames}) if shrink == 1 else smaller(scene, shrink, frames)


def _one(scene: Scene, folder: Path) -> None:
    began = time.process_time()
    try:
        found = run_scene(scene, folder)
    except Cancelled:
        raise
    except Exception:  # noqa: BLE001 - one scene that fails must not hide the others
        print(f"{scene.name:<19} FAILED\n{traceback.format_exc()}", flush=True)
        return
    print(_row(scene, found, time.process_time() - began), flush=True)


def _row(scene: Scene, s: SceneScore, cpu_s: float) -> str:
    return (
        f"{scene.name:<19}{scene.frames:>6}{s.bias_mm:>+10.4f}{s.median_mm:>+10.4f}{s.rms_mm:>10.4f}{s.stated_mm:>10.4f}"
        f"{s.inside_95:>8.3f}{s.coverage:>7.3f}{s.distance_percent:>+8.3f}%"
        f"{s.distance_sigma_percent:>6.3f}{cpu_s:>5.0f}"
    )


if __name__ == "__main__":
    main()
