"""The names of figures of a run on pages are plain words, not names of the program."""

import pytest

from pipeline.artefacts.measured import RingValidity
from pipeline.pages.notation import SAMPLE_REASONS, STAGES, figure_name, stage_title
from stages.catalogue import PIPELINE


def test_every_reason_and_every_stage_has_a_plain_name() -> None:
    assert set(SAMPLE_REASONS) == {v.name.lower() for v in RingValidity}
    assert set(STAGES) == {stage.name for stage in PIPELINE}
    assert all(" " in stage_title(s) or stage_title(s)[0].isupper() for s in STAGES)


@pytest.mark.parametrize(
    ("raw", "plain"),
    [
        ("ring samples rejected: no_line", "ring samples not used: no laser line there"),
        (
            "overlay deviation_nominal: beyond the range",
            "deviation from the nominal diameter: share beyond the last colour",
        ),
        ("overlay uncertainty: range", "1 σ of the radius: value of the last colour"),
        ("rejected: coverage too low", "not used: coverage too low"),
        ("mesh: RMS decimation error", "decimation error, root mean square"),
        ("median 1 sigma of the radius, random part", "median 1 σ of the radius, random part"),
        ("mean radius", "mean radius"),
    ],
)
def test_figures_have_plain_names(raw: str, plain: str) -> None:
    assert figure_name(raw) == plain
