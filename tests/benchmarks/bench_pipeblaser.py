"""One real frame of a fisheye laser-ring probe, re-simulated with each of its two published models.

``python -m tests.benchmarks.bench_pipeblaser [PICTURE]`` prints how far the simulated ring lies from the real
one and writes the picture: real, simulated, and the residual around the ring. Pipe radius and pose are not
published, so they are fitted (5 numbers); camera and laser plane are taken as published. The frame lies in
the shared folder beside the project; without it nothing is done.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pipeline.artefacts import RingValidity
from pipeline.geometry.axis import straight_axis
from pipeline.instrument.camera.base import Camera
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe, Shutter
from pipeline.recording.base import FrameTable, PipeFacts
from pipeline.simulator.effects.parts import with_laser
from pipeline.simulator.effects.photometric import line_peak
from pipeline.simulator.exact import exact_rings
from pipeline.simulator.instrument import LedRing, TrueCamera, TrueInstrument, TrueLaser, TrueSensor
from pipeline.simulator.motion import Motion, constant
from pipeline.simulator.profile import LineProfile
from pipeline.simulator.render import renderer_of
from pipeline.simulator.scene import Rendering
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.wall.base import Wall, WallGrid
from stages.rings.colour import excess_weights, mix
from stages.rings.sectors import cut_sectors
from stages.rings.trace import trace_ring
from tests.resimulation import off_line
from tests.shared_data import PROJECT_ROOT

Float = NDArray[np.float64]
_FOLDER = PROJECT_ROOT.parent / "shared" / "real" / "pipeblaser_cmu"
_RED_NM = 650.0
_AZIMUTHS, _EVERY = 1440, 8
# Kannala-Brandt and MEI of the second unit, and the plane published with it: a x + b y + c z + d = 0, metres.
_MODELS = {"Kannala-Brandt": "v2_calib.yaml", "MEI": "v2_vins.yaml"}
_PLANE = (0.554838, 0.50734, -100.0, 9.74935)
_START_MM = 203.0


class Ring:
    """A picture's ring: image radius (A,), NaN where none was found, and its width, px."""

    def __init__(self, image: NDArray[np.uint8], camera: Camera) -> None:
        sectors = cut_sectors(camera.image_size, camera.centre_px, _AZIMUTHS)
        trace = trace_ring(mix(image, excess_weights(_RED_NM)), sectors, 255.0)
        if trace is None:
            raise SystemExit("the picture shows no ring")
        good = trace.validity == RingValidity.VALID
        self.azimuth_rad = sectors.azimuth_rad
        self.radius_px = np.where(good, trace.fit.radius_px, np.nan)
        self.width_px = float(np.median(trace.fit.width_px[good]))
        self.grey = float(np.median(trace.fit.amplitude[good]))


def main() -> None:
    if not _FOLDER.exists():
        print("nothing done: real/pipeblaser_cmu is not in the shared folder beside the project")
        return
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "build/pipeblaser.png")
    real = cv2.imread(str(_FOLDER / "v2" / "ring_img001.png"))
    shown = {name: _resimulated(real, name, file) for name, file in _MODELS.items()}
    picture.parent.mkdir(parents=True, exist_ok=True)
    _draw(real, shown, picture)
    print(f"picture: {picture.resolve()}")


def _resimulated(real: NDArray[np.uint8], name: str, file: str) -> tuple[NDArray[np.uint8], Float, Float]:
    """Return the simulated frame, azimuths and real less simulated image radius (A,), px; print figures."""
    camera = read_camera(_FOLDER / "config" / file)
    ring = Ring(real, camera)
    scene = _fitted(camera, ring)
    frame = renderer_of(scene).frame(0)
    again = Ring(frame, camera)
    exact = exact_rings(scene, [0], ring.azimuth_rad, camera.centre_px)[0]
    residual = ring.radius_px - again.radius_px
    mm = _mm_per_px(scene, ring, exact)
    seen = np.isfinite(residual)
    rms = float(np.sqrt(np.mean(residual[seen] ** 2)))
    own = again.radius_px - exact
    print(
        f"{name}: diameter {scene.facts.nominal_diameter_mm:.1f} mm, "
        f"real less simulated {np.mean(residual[seen]):+.3f} px mean, {rms:.3f} px RMS = {rms * mm:.2f} mm, "
        f"95 % within {np.percentile(np.abs(residual[seen]), 95):.2f} px, seen {100 * seen.mean():.0f} %; "
        f"line width {ring.width_px:.2f} px real, {again.width_px:.2f} px simulated; "
        f"simulated less exact {np.nanmean(own):+.4f} px mean, {np.nanstd(own):.4f} px"
    )
    harmonics = [2 * abs(np.nanmean(residual * np.exp(-1j * m * ring.azimuth_rad))) for m in range(1, 7)]
    print(f"  its harmonics 1 to 6: {', '.join(f'{h:.2f}' for h in harmonics)} px")
    return frame, ring.azimuth_rad, residual


def _fitted(camera: Camera, ring: Ring) -> SceneTruth:
    """Return the scene whose exact ring lies nearest to the measured one: bore, offset and lean are free."""
    take = np.flatnonzero(np.isfinite(ring.radius_px))[::_EVERY]
    outward = np.stack([np.cos(ring.azimuth_rad[take]), np.sin(ring.azimuth_rad[take])], -1)

    def off(x: Float) -> Float:
        beyond = off_line(_scene(camera, x, ring), 0, camera.centre_px, outward, ring.radius_px[take])
        return np.nan_to_num(beyond, nan=10.0)

    start = np.array([_START_MM, 0.0, 0.0, 0.0, 0.0])
    scale = np.array([1.0, 1.0, 1.0, 0.01, 0.01])
    found = least_squares(off, start, x_scale=scale, diff_step=1e-4 * scale, loss="soft_l1")
    return _scene(camera, found.x, ring)


def _scene(camera: Camera, x: Float, ring: Ring) -> SceneTruth:
    """Return the scene of a bore of radius x[0], the camera off its axis by x[1:3] and leaning by x[3:5]."""
    radius = float(x[0])
    a, b, c, d = _PLANE
    sheet = LaserSheet(-1000 * d / c, -a / c, -b / c)
    along = radius / sheet.baseline_mm * _px_per_mm(camera, radius, sheet.baseline_mm)
    profile = LineProfile(ring.width_px / along)
    probe = Probe(
        camera, sheet, np.zeros((len(camera.parameter_names) + 12, 12 + len(camera.parameter_names)))
    )
    laser = TrueLaser(sheet, profile=profile, colour_bgr=(0.05, 0.1, 1.0))
    grid, shape = WallGrid(-50.0, 5.0, 121, 720), (121, 720)
    wall = Wall(
        straight_axis(-50.0, 550.0), grid, np.full(shape, radius, np.float32),
        grid, np.full((*shape, 3), 0.4, np.float32),
    )  # fmt: skip
    scene = SceneTruth(
        "pipeblaser", "inspection", 0, probe,
        TrueInstrument(TrueCamera(camera), laser, LedRing(), TrueSensor(psf_sigma_px=0.3), Shutter()),
        wall, PipeFacts(2 * radius), Motion(constant(0.0), *map(constant, x[1:].tolist())), None,
        FrameTable(np.zeros(1, int), np.zeros(1), np.array(["laser"])), 1.0, Rendering.model_validate({}),
    )  # fmt: skip
    power = laser.power_mm * ring.grey / 255 / line_peak(scene)
    return with_laser(scene, power_mm=power)


def _px_per_mm(camera: Camera, radius_mm: float, z_mm: float) -> float:
    """Return by how much the image radius grows with the wall's, px/mm."""
    place = np.array([[radius_mm, 0.0, z_mm], [radius_mm + 0.1, 0.0, z_mm]])
    uv = camera.project(place).uv
    return float(np.linalg.norm(uv[1] - uv[0]) / 0.1)


def _mm_per_px(scene: SceneTruth, ring: Ring, exact: Float) -> float:
    """Return the stated instrument's radius for a pixel of image radius, typical."""
    probe = scene.stated
    outward = np.stack([np.cos(ring.azimuth_rad), np.sin(ring.azimuth_rad)], -1)
    near, far = (
        np.linalg.norm(probe.triangulate(probe.camera.centre_px + r[:, None] * outward)[:, :2], axis=1)
        for r in (exact, exact + 1)
    )  # fmt: skip
    return float(np.nanmedian(far - near))


def _draw(
    real: NDArray[np.uint8], shown: dict[str, tuple[NDArray[np.uint8], Float, Float]], file: Path
) -> None:
    figure = Figure(figsize=(12, 8.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 3, height_ratios=(1.5, 1))
    pictures = {"real frame": real, **{f"simulated, {name}": frame for name, (frame, *_) in shown.items()}}
    for column, (name, image) in enumerate(pictures.items()):
        axes = figure.add_subplot(grid[0, column])
        axes.imshow(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
        axes.set_title(name, loc="left")
        axes.set_axis_off()
    axes = figure.add_subplot(grid[1, :])
    for name, (_, azimuth, residual) in shown.items():
        axes.plot(np.degrees(azimuth), residual, ".", ms=2.5, label=name)
    axes.axhline(0, color="#5b6875", lw=0.8)
    axes.set(xlabel="image azimuth, °", ylabel="real less simulated ring, px", xlim=(-180, 180))
    axes.legend()
    figure.savefig(file, dpi=90)


if __name__ == "__main__":
    main()
