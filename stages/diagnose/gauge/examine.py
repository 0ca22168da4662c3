"""A gauge run examined: what was found in rings and fiducials, judged against rivals, and confirmed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from pipeline.errors import UnusableError
from pipeline.instrument.probe import Probe
from stages.calibrate.gauge.calibrate import MeasuredRun
from stages.diagnose.effects.base import EffectModel
from stages.diagnose.gauge.confirm import confirmations
from stages.diagnose.gauge.fit import fit
from stages.diagnose.gauge.judge import Judged, Verdicts, judge
from stages.diagnose.gauge.prepare import prepare
from stages.diagnose.gauge.search import DETECTED, Search, search
from stages.diagnose.inference import stated_belief
from stages.diagnose.result import Confirmation


@dataclass(frozen=True)
class Examined:
    """What rings and fiducials of a gauge run say.

    Attributes
    ----------
    searched : Search
    verdicts : Verdicts or None
        None when nothing beyond the stated instrument was found.
    confirmed : tuple of tuple of Confirmation
        For each term of the likeliest hypothesis.
    """

    searched: Search
    verdicts: Verdicts | None
    confirmed: tuple[tuple[Confirmation, ...], ...]

    @property
    def global_p(self) -> float:
        """Chance of such measurements when nothing is hidden."""
        return self.searched.steps[0].global_p

    @property
    def best(self) -> Judged | None:
        """The likeliest hypothesis, if anything was found."""
        return self.verdicts.judged[0] if self.verdicts is not None else None


def examine(run: MeasuredRun, library: Mapping[str, EffectModel], probe: Probe) -> Examined:
    """Search a gauge run for left-out effects.

    Raises
    ------
    UnusableError
        When the run does not determine its own poses.
    """
    stated = stated_belief(probe)
    try:
        # More threads gain nothing on blocks this small, and stall when the machine is busy.
        with threadpool_limits(1):
            measurements, start = prepare(run)
            searched = search(measurements, fit(measurements, start, ()), library, stated)
            if searched.steps[0].global_p > DETECTED:
                return Examined(searched, None, ())
            verdicts = judge(searched, library, stated)
            best = verdicts.judged[0]
            confirmed = tuple(
                confirmations(searched.run, best, verdicts.regimes, term, stated) for term in best.fit.terms
            )
    except np.linalg.LinAlgError as error:
        raise UnusableError("diagnose", f"the gauge run does not determine its poses ({error})") from error
    return Examined(searched, verdicts, confirmed)
