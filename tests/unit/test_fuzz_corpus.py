"""Every parser accepts its good input, and accepts or refuses the inputs kept from the search for crashes."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

from pipeline.errors import InputError
from tests.fuzz.targets import TARGETS

CORPUS = Path(__file__).parents[1] / "fuzz" / "corpus"


KEPT = [(t, f) for t in TARGETS for f in sorted((CORPUS / t.replace(" ", "_")).glob("*"))]


@pytest.mark.parametrize("target", TARGETS)
def test_a_good_input_is_accepted(target: str) -> None:
    TARGETS[target].take(TARGETS[target].seed())


@pytest.mark.parametrize(("target", "file"), KEPT, ids=lambda v: getattr(v, "name", v))
def test_kept_inputs_are_accepted_or_refused(target: str, file: Path) -> None:
    with suppress(InputError):
        TARGETS[target].take(file.read_bytes())


@pytest.mark.parametrize("target", TARGETS)
def test_half_of_a_good_input_and_an_empty_one_are_accepted_or_refused(target: str) -> None:
    good = TARGETS[target].seed()
    for data in (good[: len(good) // 2], b"", b"\0" * 64, good[::-1]):
        with suppress(InputError):
            TARGETS[target].take(data)
