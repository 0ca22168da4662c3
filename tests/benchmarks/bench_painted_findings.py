"""Whether findings and their depths are true: defects are inserted into the rings of finished runs.

usage: python -m tests.benchmarks.bench_painted_findings RUN=RECORDING ... [--draws N] [--keep FOLDER]
[--say-sure] [--shift-truth MM] [--limit SIZE DEPTH]

The background are the real rings of a run, with all flaws of its pictures; it was not made by the program
under test. Defects of drawn kind, size and depth are inserted into the rings where the run places each sample
on the wall; the wall is then accumulated and searched as in a run. Each recording is also used with every
second ring only, the even and the odd ones: other noise, fewer rings on each defect. The recording's own
defects are not counted.

Printed are: how often a finding of stated confidence is real, with the expected and the counted false ones;
how many depths lie in their 95 % interval; how many defects are missed. ``--say-sure`` states 1 for every
finding, and ``--shift-truth`` moves the inserted defects by so much after the search: then the tables must
get bad.

With ``--limit 1 1`` only slim round defects are inserted that have the smallest diameter and depth of which
the run says, for that stretch of the pipe, that nine of ten are found; other numbers multiply diameter and
depth, and with .5 most must be missed.
"""

from __future__ import annotations

import argparse
import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.findings import Defect, Defects
from pipeline.artefacts.measured import RingSamples
from pipeline.machine.stage import Context
from stages.defects import DefectParameters, find_defects
from tests.benchmarks.bench_findings import Counted, table
from tests.benchmarks.painted_rings import (
    AT_LIMIT,
    Background,
    Painted,
    at_limit,
    background,
    drawn,
    painted_rings,
    turned,
    walled,
)
from tests.benchmarks.true_wall import TrueWall
from tests.quiet import quiet_context

_ASKED_MM = 0.4
_NEAR_MM = 2.5
_LEAST_MM, _LEAST_SHARE = 0.1, 0.3
_EVERY = {"all": slice(None), "even": slice(0, None, 2), "odd": slice(1, None, 2)}


@dataclass(frozen=True)
class Case:
    """The inserted defects and the findings."""

    name: str
    painted: list[Painted]
    found: Defects
    own: Float
    true: TrueWall | None
    radius_mm: float
    length_mm: float
    told: dict[str, float]


def searched(bg: Background, rings: RingSamples, context: Context) -> Defects:
    """Return the findings of these rings."""
    wall = walled(bg, rings, context)
    return find_defects(bg.recording, wall, bg.photo, DefectParameters(), context, rings)


def cases(bg: Background, draws: int, seed: int, limit: tuple[float, float] | None = None) -> Iterator[Case]:
    """Yield every background with every set of rings and every draw."""
    for n in range(draws):
        part = list(_EVERY)[n % 3]
        some = bg.every(_EVERY[part])
        told: dict[str, float] = {}

        def report(name: str, value: float, unit: str = "", told: dict[str, float] = told) -> None:
            told[name] = value

        context = replace(quiet_context(n), report=report)
        plain = walled(some, some.rings, context).radius_map
        rows = plain.distance_mm[np.isfinite(plain.radius_mm).mean(1) > 0.5]
        radius = float(np.nanmedian(plain.radius_mm))
        span, random = (rows[0] + 4, rows[-1] - 4), np.random.default_rng([seed, n])
        kind = None
        if limit is not None:
            kind = at_limit(searched(some, some.rings, context), *limit)
        defects = drawn(some, radius, span, random, kind)
        found = searched(some, painted_rings(some, defects), context)
        yield Case(
            f"{bg.name}/{part}/{n}", defects, found, bg.own, bg.true, radius, float(np.ptp(rows)), told
        )


def true_extreme(case: Case, found: Defect) -> float:
    """Return the largest true departure with a finding's sign in its outline, averaged over a millimetre."""
    grid_s = np.arange(found.distance_from_mm - _NEAR_MM, found.distance_to_mm + _NEAR_MM, 0.2)
    first, last = (np.radians(30 * c - 90) for c in (found.clock_from, found.clock_to))
    span = (last - first) % (2 * np.pi) if found.clock_to - found.clock_from < 12 else 2 * np.pi
    margin = _NEAR_MM / case.radius_mm
    grid_a = np.arange(first - margin, first + span + margin, 0.2 / case.radius_mm)
    s, a = np.meshgrid(grid_s, grid_a, indexing="ij")
    relief = sum((d.relief(s, a, case.radius_mm) for d in case.painted), np.zeros_like(s))
    mean = relief + (_natural(case.true, grid_s, grid_a) if case.true is not None else 0.0)
    kernel = np.ones(5) / 5
    for axis in (0, 1):
        mean = np.apply_along_axis(lambda v: np.convolve(v, kernel, "same"), axis, mean)
    return float((np.sign(found.depth_mm) * mean).max(initial=0.0))


def _natural(true: TrueWall, distance: Float, azimuth: Float) -> Float:
    """Return the relief (n, m) that the wall had before defects were inserted."""
    step = 2 * np.pi / len(true.azimuth_rad)
    column = np.rint((azimuth - true.azimuth_rad[0]) / step).astype(int) % len(true.azimuth_rad)
    row = np.rint((distance - true.distance_mm[0]) / (true.distance_mm[1] - true.distance_mm[0])).astype(int)
    return np.asarray(true.relief_mm[np.clip(row, 0, len(true.distance_mm) - 1)][:, column], float)


def _is_own(case: Case, found: Defect) -> bool:
    """Return whether a finding lies on one of the recording's own defects."""
    first, last = (np.radians(30 * c - 90) for c in (found.clock_from, found.clock_to))
    middle, half = first + (last - first) % (2 * np.pi) / 2, (last - first) % (2 * np.pi) / 2 * case.radius_mm
    for s, psi, along, around in case.own:
        if found.distance_from_mm - along - 6 < s < found.distance_to_mm + along + 6 and (
            not np.isfinite(around) or case.radius_mm * abs(turned(middle - psi)) < around + half + 6
        ):
            return True
    return False


def counted(case: Case) -> tuple[list[Counted], list[Float], int, int]:
    """Return findings beside the truth, (found, true, σ) of real ones, and demanded and missed defects."""
    out, depths = [], []
    every = [(d, True) for d in case.found.items] + [(d, False) for d in case.found.unconfirmed]
    for found, confirmed in every:
        if _is_own(case, found):
            continue
        extreme = true_extreme(case, found)
        real = extreme > max(_LEAST_MM, _LEAST_SHARE * abs(found.depth_mm))
        stated, depth, sigma = found.probability, found.depth_mm, found.depth_sigma_mm
        out.append(Counted(case.name, confirmed, stated, real, depth, sigma))
        if real and confirmed:
            depths.append(np.array([abs(found.depth_mm), extreme, found.depth_sigma_mm]))
    asked = [d for d in case.painted if d.kind == AT_LIMIT or _is_asked(d)]
    missed = [d for d in asked if not any(_covers(case, f, d) for f in case.found.items)]
    return out, depths, len(asked), len(missed)


def _is_asked(d: Painted) -> bool:
    return abs(d.depth_mm) >= _ASKED_MM and min(d.length_mm, d.width_mm) >= 3


def _covers(case: Case, found: Defect, d: Painted) -> bool:
    first, last = (np.radians(30 * c - 90) for c in (found.clock_from, found.clock_to))
    half = (last - first) % (2 * np.pi) / 2
    aside = (abs(turned(d.azimuth_rad - first - half)) - half) * case.radius_mm
    along = abs(d.distance_mm - (found.distance_from_mm + found.distance_to_mm) / 2) - found.length_mm / 2
    return along < max(_NEAR_MM, d.length_mm / 2) and aside < max(_NEAR_MM, d.width_mm / 2)


def shifted(case: Case, shift_mm: float) -> Case:
    """Return a case whose inserted defects are moved in the truth."""
    moved = [replace(d, distance_mm=d.distance_mm + shift_mm) for d in case.painted]
    return replace(case, painted=moved)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--draws", type=int, default=3)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--say-sure", action="store_true")
    parser.add_argument("--shift-truth", type=float, default=0.0)
    parser.add_argument("--limit", type=float, nargs=2)
    given = parser.parse_args()
    every: list[Case] = []
    for number, pair in enumerate(given.runs):
        run, truth = map(Path, pair.split("="))
        kept = given.keep / f"{pair.replace('/', '_')}.pickle" if given.keep else None
        if kept and kept.is_file():
            some = pickle.loads(kept.read_bytes())
        else:
            some = list(cases(background(run, truth), given.draws, number, given.limit))
            if kept:
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_bytes(pickle.dumps(some))
        for case in some:
            print(line(shifted(case, given.shift_truth)), flush=True)
        every += some
    summary(every, given)


def line(case: Case) -> str:
    """Return the result of one case in words."""
    found, depths, asked, missed = counted(case)
    sure, apart = ([c for c in found if c.confirmed is which] for which in (True, False))
    z = [(d[0] - d[1]) / d[2] for d in depths]
    return (
        f"{case.name}: painted {len(case.painted)}, confirmed {len(sure)}, "
        f"false {sum(not c.real for c in sure)} of {sum(1 - c.stated for c in sure):.2f} expected, "
        f"unconfirmed {len(apart)} ({sum(c.real for c in apart)} real), missed {missed}/{asked}, "
        f"depth rms z {np.sqrt(np.mean(np.square(z))) if z else 0:.2f}"
        + "".join(f", {k} {v:.2f}" for k, v in case.told.items() if "expected" in k)
    )


def summary(every: Sequence[Case], given: argparse.Namespace) -> None:
    """Print the tables over all cases."""
    told = [counted(shifted(c, given.shift_truth)) for c in every]
    found = [replace(c, stated=1.0) if given.say_sure else c for part in told for c in part[0]]
    depths = np.array([d for part in told for d in part[1]]).reshape(-1, 3)
    metres = sum(c.length_mm for c in every) / 1000
    for name, some in (("confirmed", True), ("unconfirmed", False)):
        print(f"\n{name}")
        chosen = [c for c in found if c.confirmed is some]
        if chosen:
            table(chosen)
    z = (depths[:, 0] - depths[:, 1]) / depths[:, 2]
    inside, error = float(np.mean(np.abs(z) < 1.96)), float(np.median(np.abs(depths[:, 0] - depths[:, 1])))
    print(
        f"\n{len(z)} depths: {100 * inside:.1f} % inside 95 %, mean z {z.mean():+.2f}, median {error:.3f} mm"
    )
    missed, asked = sum(p[3] for p in told), sum(p[2] for p in told)
    print(f"missed {missed} of {asked} deep enough; {metres:.2f} m of wall")


if __name__ == "__main__":
    main()
