"""Two runs through one simulated pipe.

They share roughness and paint, but not noise or the shifts of their rings.
"""

from dataclasses import replace

import numpy as np

from pipeline.artefacts.comparison import OutlinedFinding
from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import WallTexture
from pipeline.artefacts.wall_map import WallMap
from stages.compare import changes, put_together
from stages.compare.growth import Resolution
from stages.compare.paired import PairedWalls
from stages.compare.registration.by_marks import RegisterParameters, register
from stages.compare.registration.marks import Surface
from tests.synthetic_wall import smooth_noise

RADIUS, LENGTH, STEP, COLUMNS = 50.0, 120.0, 0.5, 720
NOISE_MM = 0.02
SHIFT_MM, ROLL_RAD, SCALE = -9.3, 0.9, 1.002
FINE = Resolution(0.1, 0.1, 1e-3, is_common=True)
NO_WELDS = np.zeros(0)
SAME = RegisterParameters()


class Pipe:
    """A pipe's roughness, paint and pits (distance, azimuth, depth, 1 σ), which all runs share."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.rough = smooth_noise(rng, (400, COLUMNS), 0.03, 6.0)
        self.paint = smooth_noise(rng, (400, COLUMNS), 1.0, 3.0)

    def at(self, field, s, psi):
        """Return a field (S, A), which begins at −40 mm, at distances (S,) and azimuths (A,)."""
        row, column = (s + 40) / STEP, np.mod((psi + np.pi) / (2 * np.pi) * COLUMNS, COLUMNS)
        i, j = np.floor(row).astype(int), np.floor(column).astype(int)
        u, v = (row - i)[:, None], (column - j)[None]
        top, low = (
            (1 - v) * field[np.ix_(k, j)] + v * field[np.ix_(k, (j + 1) % COLUMNS)] for k in (i, i + 1)
        )
        return (1 - u) * top + u * low

    def surface(self, pits, seed, shift=0.0, roll=0.0, scale=1.0):
        """Return the surface measured by a run.

        Its distances are ``scale`` s + ``shift``, its azimuths ψ + ``roll``.
        """
        own, psi = np.arange(0.0, LENGTH, STEP), -np.pi + 2 * np.pi / COLUMNS * np.arange(COLUMNS)
        s, azimuth = (own - shift) / scale, psi - roll
        radius = RADIUS + self.at(self.rough, s, azimuth)
        for at, around, depth, width in pits:
            turn = np.mod(azimuth - around + np.pi, 2 * np.pi) - np.pi
            radius += depth * np.exp(-((s - at)[:, None] ** 2 + (RADIUS * turn) ** 2) / (2 * width**2))
        rng = np.random.default_rng(seed)
        radius += smooth_noise(rng, radius.shape, NOISE_MM, 0.8)
        # errors of each ring: size, position and ovality
        for m in range(3):
            radius += 0.05 * rng.standard_normal((len(s), 1)) * np.cos(m * psi - rng.uniform(0, 6))
        full = np.full(radius.shape, 0.05, np.float32)
        wall = WallMap(own, psi, radius.astype(np.float32), full, np.full_like(full, NOISE_MM))
        grey = 120 + 30 * self.at(self.paint, s, azimuth) + 4 * rng.standard_normal(radius.shape)
        bgra = np.dstack([np.clip(grey, 1, 255)] * 3 + [np.full(grey.shape, 255)]).astype(np.uint8)
        return Surface(wall, WallTexture(bgra, 0.0, STEP, -np.pi, 2 * np.pi / COLUMNS))


PIPE = Pipe(1)


def unseen(done, total):
    """Accept progress without showing it."""


PLACES = tuple((s, psi) for s in (35.0, 60.0, 85.0) for psi in (-2.5, -1.0, 0.5, 2.0))


def family(growth_mm, seed, found_now=12):
    """Return the state of twelve pits of 0.5 mm that grow by ``growth_mm`` (12,), by their number."""
    names = [finding(k, *p) for k, p in enumerate(PLACES)]
    before = [(*p, 0.5, 2.0) for p in PLACES]
    after = [(*p, 0.5 + g, 2.0) for p, g in zip(PLACES, growth_mm, strict=True)]
    found = compared(before, after, names, names[:found_now], seed)
    return {int((c.place.now or c.place.earlier).id): c for c in found}


def finding(name, s, psi, half=6.0, kind="pit"):
    turn = half / RADIUS
    outline = ((s - half, psi - turn), (s + half, psi - turn), (s + half, psi + turn), (s - half, psi + turn))
    return OutlinedFinding(str(name), DefectKind(kind), outline, 0.5, 0.02)


def moved(found):
    """Return an earlier finding at the place where the later run has it."""
    outline = tuple((SCALE * s + SHIFT_MM, psi + ROLL_RAD) for s, psi in found.outline)
    return replace(found, outline=outline)


def later(pits, seed, pipe=PIPE):
    return pipe.surface(pits, seed, SHIFT_MM, ROLL_RAD, SCALE)


def compared(earlier_pits, later_pits, earlier_found, later_found, seed=10, wet_mm=0.0):
    """Return the changes; in half of the pipe the later picture is displaced by ``wet_mm`` (1 σ)."""
    before, after = PIPE.surface(earlier_pits, seed), later(later_pits, seed + 1)
    registration = register(before, after, NO_WELDS, SAME)
    places = put_together(earlier_found, [moved(f) for f in later_found], registration, RADIUS)
    displaced = wet_mm * (after.wall.distance_mm < LENGTH / 2)
    wall = replace(after.wall, displaced_mm=displaced)
    return changes(places, PairedWalls(before.wall, wall, registration), FINE, unseen)
