"""How similar recorded frames and the model look in the review's page: same place, lens and light.

boresight run RECORDING -o RUN --set premises.withhold=10

python -m tests.benchmarks.bench_same_view RUN [--frames N] [--pictures FOLDER]

Lit frames that no stage of the run has used are compared; where the run withheld none, frames that it used
are, and the output says so. The page turns the model to four places around the wall, 60° off the camera's
axis. Frames that are lit while the laser is on show its line, which the model lacks: such recordings reach
some 25 dB.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from pipeline.artefacts.measured import Trajectory
from pipeline.geometry.axis import distance_along
from pipeline.recording import open_recording
from pipeline.recording.base import Illumination
from pipeline.recording.checks import CheckedFrames
from pipeline.review.run_files import RunFiles
from tests.review_browser import chromium, tab
from tests.review_server import ReviewServer
from tests.same_view import side_by_side

HOURS = (12, 3, 6, 9)
POLAR_RAD = 1.05


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--pictures", type=Path, help="folder for model, frame and difference, times 4")
    given = parser.parse_args()
    frames, what = lit_frames(RunFiles(given.run), given.frames)
    print(f"{len(frames)} {what} frames at {len(HOURS)} places each")
    measure(given.run, frames, given.pictures)


def lit_frames(files: RunFiles, most: int) -> tuple[list[tuple[int, float]], str]:
    """Return lit frames with the distances of their cameras, and whether the run has used them."""
    checked, trajectory = files.artefact(CheckedFrames), files.artefact(Trajectory)
    light = open_recording(Path(files.record()["recording"]["path"])).frames
    lit = light.frame[np.isin(light.illumination, [Illumination.LED, Illumination.BOTH])]
    lit = lit[np.isin(lit, trajectory.frame)]
    if checked.withheld is not None:
        lit = lit[np.isin(lit, checked.frame[checked.withheld])]
    few = lit[np.unique(np.linspace(0, len(lit) - 1, most + 2).round().astype(int))[1:-1]]
    at = distance_along(trajectory.axis, trajectory.T_pc[np.searchsorted(trajectory.frame, few)])
    what = "measured" if checked.withheld is None else "withheld"
    return [(int(f), float(s)) for f, s in zip(few, at, strict=True)], what


def measure(run: Path, frames: list[tuple[int, float]], pictures: Path | None) -> None:
    """Open the page and compare."""
    found = []
    with chromium() as browser, ReviewServer(run) as server:
        context = browser.new_context(viewport={"width": 1280, "height": 720})
        with tab(context, server.origin) as page:
            page.open(server.address, model=True)
            radius = float(page.js("boresight.session.run.radius_mm"))
            for frame, at in frames:
                for hour in HOURS:
                    spot = at + radius / np.tan(POLAR_RAD), np.radians(30 * (hour - 3))
                    alike = side_by_side(page, frame, *map(float, spot))
                    found.append((alike.psnr_db, alike.brighter))
                    print(
                        f"frame {frame:5}, {hour:2} o'clock: {alike.psnr_db:5.1f} dB, model "
                        f"{alike.brighter:.3f} times as bright, {100 * alike.compared:3.0f} % compared"
                    )
                    if pictures:
                        pictures.mkdir(parents=True, exist_ok=True)
                        both = [alike.model, alike.frame, 128 + 4 * (alike.model - alike.frame)]
                        grey = np.nan_to_num(np.clip(np.hstack(both), 0, 255)).astype(np.uint8)
                        cv2.imwrite(str(pictures / f"{frame}-{hour}.png"), grey)
    psnr, brighter = np.array(found).T
    print(f"PSNR {psnr.min():.1f} dB at worst, {np.median(psnr):.1f} dB median")
    print(f"brightness {brighter.min():.3f} to {brighter.max():.3f}")


if __name__ == "__main__":
    main()
