"""What the line's light says in the first half of a recording against the second."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from stages.diagnose.agreement import Agreement, Part, agreement
from stages.diagnose.profile.cells import Cells
from stages.diagnose.profile.finding import Finding, Size

Test = Callable[[Cells], tuple[Finding, ...]]
_HALVES = ("first half of the frames", "second half of the frames")
# A jackknife over fewer blocks gives no usable σ.
_LEAST_BLOCKS = 3


def with_halves(findings: tuple[Finding, ...], tests: Sequence[Test], cells: Cells) -> tuple[Finding, ...]:
    """Return the findings, those that were found with what each half of the frames says of the other.

    ``tests`` are those that found something; they are repeated on each half.
    """
    count = len(cells.frames)
    middle = count // 2
    if middle < _LEAST_BLOCKS:
        return findings
    halves = [_of_half(cells.of_blocks(*ends), tests) for ends in ((0, middle), (middle, count))]
    return tuple(replace(f, agreements=_halves_agree(f, *halves)) if f.found else f for f in findings)


def _of_half(half: Cells, tests: Sequence[Test]) -> dict[str, Finding]:
    return {f.effect: f for test in tests for f in test(half)}


def _halves_agree(
    whole: Finding, first: Mapping[str, Finding], second: Mapping[str, Finding]
) -> tuple[Agreement, ...]:
    """Return whether the halves agree on the first quantity; nothing where either tells too little."""
    each = [half[whole.effect].sizes[:1] for half in (first, second) if whole.effect in half]
    sizes = [size for sizes in each for size in sizes]
    if len(sizes) < 2:
        return ()
    parts = [Part(where, _words(s), np.array([s.value])) for where, s in zip(_HALVES, sizes, strict=True)]
    variance = [np.array([[s.sigma**2]]) for s in sizes]
    out = agreement(parts[0], parts[1], (variance[0], variance[1]), variance[0] + variance[1])
    return () if out is None else (out,)


def _words(size: Size) -> str:
    return f"{size.name} {size.value:.4g} (± {size.sigma:.2g}{f' {size.unit}' if size.unit else ''})"
