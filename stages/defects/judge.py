"""Decide which findings are confirmed, with which probability, and say why the others are not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.artefacts.findings import Defect
from stages.defects.all_round import IS_STEP, MAY_BE_STEP
from stages.defects.corroborate import Evidence
from stages.defects.credibility import (
    COUNTED,
    MOST_SURE,
    Credibility,
    chance_of_depth,
    credibility_of,
    is_depth_known,
)
from stages.defects.noise_tail import NoiseTail
from stages.defects.segment import Region
from stages.defects.surface import MeasuredWall

# A finding fixed to the image, or where the line ends, is as likely as not on the wall: nothing decides it.
_WALL_OR_NOT = 0.5
_UNSURE = "Its depth is less than twice its σ, so that it may be zero"
# A finding whose total σ exceeds this many times its depth is not confirmed. Chosen: a finding that a noise
# filter or a codec flattened to a third is still confirmed, with a lower bound of its depth.
_VAGUE = 4.0
_IS_VAGUE = (
    "The σ of its depth is more than four times the measured depth, as pictures that repeat parts of earlier "
    "ones may have made it that much smaller"
)
_AT_LEAST = (
    "This depth is a lower bound, with ± {:.2f} mm from noise and displaced pictures. The rest of σ is what "
    "pictures that repeat parts of earlier ones may have taken off the depth."
)
_LONE = (
    "This depth is a lower bound: single rings show up to {:.2f} mm, but the rings beside them do not. That "
    "may be a glint, or a pit so narrow that no other ring crosses it."
)


@dataclass(frozen=True)
class Found:
    """A region deep enough to be reported, described as if it were certainly real.

    Attributes
    ----------
    region : Region
    defect : Defect
    by_noise : Defect
        The same with σ from noise and displaced pictures, before codec or single deep rings widen it.
    evidence : Evidence
    bead : float
        Probability that it is not a step of the bore.
    contradicted_mm : float, optional
        The larger depth shown by rings that their neighbours contradict; None where there are none.
    sigma_without_them_mm : float, optional
        1 σ of the depth before these rings widen it; None where there are none.
    """

    region: Region
    defect: Defect
    by_noise: Defect
    evidence: Evidence
    bead: float
    contradicted_mm: float | None = None
    sigma_without_them_mm: float | None = None

    @property
    def step(self) -> bool:
        """Whether it is more likely a step of the bore."""
        return self.bead < COUNTED

    @property
    def uncontradicted(self) -> Evidence:
        """The evidence without the strength that single rings add which their neighbours contradict."""
        if self.contradicted_mm is None:
            return self.evidence
        by_others = abs(self.by_noise.depth_mm) / self.by_noise.depth_sigma_mm
        return replace(self.evidence, score=min(self.evidence.score, by_others))

    @property
    def flattened(self) -> bool:
        """Whether its depth is significant against noise, but not with what flattening may have taken off."""
        if self.contradicted_mm is not None:
            return False
        return is_depth_known(self.by_noise) and not is_depth_known(self.defect)

    @property
    def vague(self) -> bool:
        """Whether flattening leaves next to nothing known of its depth; single deep rings do not count."""
        sigma_mm = self.sigma_without_them_mm
        if sigma_mm is None:
            sigma_mm = self.defect.depth_sigma_mm
        return sigma_mm > _VAGUE * abs(self.defect.depth_mm)

    def with_probability(self, probability: float, counts: bool) -> Defect:
        """Return it with its probability and, if it counts, a sentence where its depth is a lower bound."""
        words = self._at_least() if counts else ""
        statement = f"{self.defect.statement} {words}".rstrip()
        sure = self.defect.confidence * probability
        return replace(self.defect, probability=probability, confidence=sure, statement=statement)

    def _at_least(self) -> str:
        if self.contradicted_mm is not None:
            return _LONE.format(abs(self.contradicted_mm))
        return _AT_LEAST.format(self.by_noise.depth_sigma_mm) if self.flattened else ""


def credibility_on(found: Sequence[Found], tail: NoiseTail, wall: MeasuredWall) -> Credibility:
    """Return what the findings show about real and false ones on this wall; welds and steps are left out."""
    used = [f for f in found if f.evidence.on_wall and not (f.region.all_round or f.step)]
    column = 2 * np.pi / wall.relief.shape[1]
    widths = [f.region.mask.shape[1] * column for f in used]
    rings = len(np.unique(wall.cloud.cloud.frame))
    return credibility_of([f.uncontradicted for f in used], widths, rings, tail)


def judged(
    found: Sequence[Found], credibility: Credibility, min_depth_mm: float
) -> tuple[list[Defect], list[Defect]]:
    """Return the confirmed findings, and the unconfirmed ones with the reason in their statement.

    What goes all round is not compared with noise and glints: its score is that of templates for narrow
    defects (open-3's weld of .9 mm in hard footage has 4.7 σ, which noise reaches twice there).
    """
    confirmed: list[Defect] = []
    unconfirmed: list[Defect] = []
    for f in found:
        deep = chance_of_depth(f.by_noise, min_depth_mm)
        real = deep if f.region.all_round else deep * credibility.chance_against_clutter(f.uncontradicted)
        real = min(real, MOST_SURE) * (1.0 if f.evidence.on_wall else _WALL_OR_NOT)
        unsure, real = real >= COUNTED > real * f.bead, real * f.bead
        counts = f.evidence.corroborated and real >= COUNTED and is_depth_known(f.by_noise) and not f.vague
        defect = f.with_probability(real, counts)
        if counts:
            confirmed.append(defect)
        else:
            doubt = f.evidence.doubt if is_depth_known(f.by_noise) or not f.evidence.corroborated else _UNSURE
            doubt = _IS_VAGUE if f.vague and f.evidence.corroborated else doubt
            doubt = MAY_BE_STEP if unsure else doubt
            doubt = f"{IS_STEP}, with a probability of {min(1 - f.bead, MOST_SURE):.2f}" if f.step else doubt
            words = f"{defect.statement} Not confirmed. {doubt}."
            unconfirmed.append(replace(defect, statement=words))
    return confirmed, unconfirmed
