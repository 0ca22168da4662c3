"""Effects on the line's light: found in whole recordings, and confirmed by each half of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stages.diagnose.profile.cells import Cells
from stages.diagnose.profile.evidence import ProfileEvidence, profile_evidence, with_halves
from stages.diagnose.profile.finding import Finding, Size, finding
from stages.rings import RingParameters, extract_rings
from tests.profile_lines import Hidden, probe, recording
from tests.quiet import quiet_context


def evidence(hidden: Hidden) -> ProfileEvidence:
    run, stated = recording(hidden), probe()
    rings = extract_rings(run, stated, RingParameters.model_validate({}), quiet_context())
    return profile_evidence(run, rings, stated, quiet_context())


def test_plain_light_gives_no_finding() -> None:
    assert evidence(Hidden()).found == ()


@pytest.mark.parametrize(
    ("hidden", "name", "size"),
    [
        (Hidden(copy=0.02, copy_mm=1.5), "tube_ghost", 0.02),
        (Hidden(ghost=0.02, tilt_x=0.01, tilt_y=0.004), "ghost_ring", 0.02),
    ],
)
def test_a_second_line_is_found_in_both_halves(hidden: Hidden, name: str, size: float) -> None:
    (found,) = evidence(hidden).found
    assert found.effect == name
    assert found.sizes[0].value == pytest.approx(size, abs=4 * found.sizes[0].sigma)
    assert [a.confirmation.agrees for a in found.agreements] == [True]
    # Whether it turns with the laser or with the camera is not tested here.
    assert found.fixed_to is None


def test_a_spot_in_the_image_is_not_a_pattern_of_pixels() -> None:
    (found,) = evidence(Hidden(dust=0.4)).found
    assert (found.effect, found.alike, found.fixed_to) == ("dust", (), "camera")


def cells(blocks: int) -> Cells:
    """Return cells of empty blocks; the tests below make up what is found in them."""
    none = np.zeros(blocks)
    return Cells(
        np.zeros(3), np.arange(blocks), np.zeros(blocks, int), np.zeros((blocks, 3)), none, none,
        np.zeros((blocks, 3)), none > 0, none, none, none, none,
        tuple(np.array([k]) for k in range(blocks)),
    )  # fmt: skip


def told(value: float, sigma: float = 0.1) -> Finding:
    return finding("line_skew", 20.0, 1e-12, (Size("skewness", "", value, sigma),), "It is skewed.")


@pytest.mark.parametrize(
    ("first", "second", "agree"),
    [
        (told(1.0), told(1.1), [True]),
        (told(1.0), told(1.9), [False]),
        (told(1.0), told(-1.0), [False]),
        (told(1.0, 0.5), told(1.1, 0.5), []),
        (told(1.0), replace(told(1.0), sizes=()), []),
    ],
)
def test_halves_confirm_contradict_or_show_too_little(
    first: Finding, second: Finding, agree: list[bool]
) -> None:
    def test(part: Cells) -> tuple[Finding, ...]:
        return (first if part.frames[0][0] == 0 else second,)

    (found,) = with_halves((told(1.0),), (test,), cells(8))
    assert [a.confirmation.agrees for a in found.agreements] == agree


def test_halves_with_too_few_blocks_are_not_used() -> None:
    (found,) = with_halves((told(1.0),), (), cells(5))
    assert found.agreements == ()
