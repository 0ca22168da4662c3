"""Judges whether a recording agrees with the stated probe, and widens σ if it does not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Float
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.motion import Rival
from pipeline.geometry.axis import distance_along, frames_at
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Context
from stages.motion.mirrored import mirrored_way

MOST_LASTING = 0.57
"""Reprojection error, in σ of matching, shared by a landmark's neighbouring matches, that is warned of: .44
to .51 in open-1, open-2, at half their size, shaken, and in a scene of ours; .18 in open-3, of much noise;
.63 in open-1 as HEVC of crf 32, .69 at crf 30, .85 with glints, dust and blur as well."""
TOO_FAR = 5.0
"""σ of a contradiction that is warned of. By independent Gaussian errors a correct probe is contradicted as
much along one of its ten or so directions once in 10⁵ recordings; by errors that matches share, more
often: how often is not known."""
_NO_EVIDENCE = 1e-4
"""Share of a direction's stated variance below which its reduction is no evidence, and a move counts in
stated σ: there 5 σ would be a change of 500 stated σ that moves the probe by .05 of one, about what the
adjustment's end leaves undone (`solver.CLOSELY`). A move by .011 σ, at a share of 5e-6, contradicted a
correct probe by 5.3 σ."""
_RING = 72
"""Points around the pipe at which its radius is computed, 5° apart, as for a calibration's errors
elsewhere."""


@dataclass(frozen=True)
class Contradiction:
    """How far the pictures contradict the stated probe.

    Attributes
    ----------
    sigmas : float
        Largest contradiction, in σ, along any direction of the stated uncertainty.
    farthest : float
        Largest change by the adjustment along any of them, in stated σ.
    moved, wanted : (P,)
        Change of the parameters by the adjustment, and that which the pictures alone ask for along the
        directions in which they contradict a correct probe.
    """

    sigmas: float
    farthest: float
    moved: Float
    wanted: Float

    @property
    def of_probe(self) -> bool:
        """Whether the stated probe cannot be right."""
        return self.farthest > TOO_FAR

    @property
    def certain(self) -> bool:
        """Whether pictures and stated probe contradict each other; texture may be wrong instead."""
        return self.sigmas > TOO_FAR


def contradiction(trajectory: Trajectory, probe: Probe) -> Contradiction:
    """Compare the adjustment's correction of the probe with that expected of a correct one.

    The adjustment weighs the stated value, of variance 1, and that of the pictures, of variance e, and moves
    the probe by x = g d, where d is their difference and g = 1 / (1 + e). A correct probe has a d of variance
    1 + e, so that x has the variance g: the reduction of the stated variance. Where pictures show little, x
    is small however wrong the statement is (A. H. Jazwinski, "Stochastic Processes and Filtering Theory",
    1970, on predicted residuals). The variance e is that of independent errors; errors that matches share
    make d larger. Without an encoder, what moves the scale of all lengths is no evidence.
    """
    unsure = probe.principal_uncertainties()
    if trajectory.instrument is None or not unsure.size:
        return Contradiction(0.0, 0.0, *np.zeros((2, len(probe.parameters))))
    moved = np.linalg.pinv(unsure) @ (trajectory.instrument - probe.parameters)
    by_pictures, left = moved_by_pictures(trajectory, probe)
    gain, direction = np.linalg.eigh(np.eye(len(moved)) - left)
    along, gain = direction.T @ by_pictures, np.where(gain > _NO_EVIDENCE, gain, 1.0)
    sigmas = np.abs(along) / np.sqrt(gain)
    wanted = np.where(sigmas > TOO_FAR, along / gain, along)
    farthest = float(np.abs(moved).max())
    return Contradiction(float(sigmas.max()), farthest, unsure @ moved, unsure @ direction @ wanted)


def moved_by_pictures(trajectory: Trajectory, probe: Probe) -> tuple[Float, Float]:
    """Return a probe's change (Q,) and its covariance left (Q, Q), both along its principal uncertainties.

    Without an encoder pictures do not show the scale of all lengths: what the adjustment says of it comes
    from the motion that it expects, smooth by so many mm, and is left out. It demanded a baseline of 8
    instead of 22 mm, by 8 σ, of a correct probe. A baseline that is stated as exact gives the scale.
    """
    assert trajectory.instrument is not None
    inverse = np.linalg.pinv(probe.principal_uncertainties())
    moved = inverse @ (trajectory.instrument - probe.parameters)
    if (own := trajectory.instrument_covariance) is None:
        return moved, np.zeros((len(moved), len(moved)))
    left = inverse @ own @ inverse.T
    baseline = probe.parameter_names.index("baseline_mm")
    if np.isfinite(trajectory.encoder_scale) or probe.covariance[baseline, baseline] == 0:
        return moved, left
    length = np.array([name.endswith("_mm") for name in probe.parameter_names])
    larger = inverse @ np.where(length, probe.parameters, 0.0)
    one, information = np.eye(len(left)), np.linalg.inv(left)
    rest = one - np.outer(larger, larger) / max(larger @ larger, np.finfo(float).tiny)
    seen = one + rest @ (information - one) @ rest
    return np.linalg.solve(seen, rest @ information @ moved), np.linalg.inv(seen)


def with_rivals(trajectory: Trajectory, others: Sequence[Trajectory]) -> Trajectory:
    """Return the trajectory with others as its rivals, and the largest difference in distance in its σ."""
    if not others:
        return trajectory
    own, *its = (distance_along(t.axis, t.T_pc) for t in (trajectory, *others))
    apart = max((s - s[0] - (own - own[0]) for s in its), key=lambda d: float(np.abs(d).max()))
    way = np.zeros((len(own), 6))
    way[:, :3] = apart[:, None] * frames_at(trajectory.axis, own)[1][:, :, 2]
    return replace(
        trajectory,
        covariance=trajectory.covariance + way[:, :, None] * way[:, None, :],
        distance_sigma_mm=float(np.hypot(trajectory.distance_sigma_mm, np.abs(apart).max())),
        rivals=tuple(Rival(t.T_pc, t.axis, t.instrument) for t in others if t.instrument is not None),
    )


def with_doubtful_instrument(
    trajectory: Trajectory, probe: Probe, lasting: float, shakes: bool
) -> Trajectory:
    """Return the trajectory, with the instrument's correction added to its σ if the correction is doubtful.

    A correction is doubtful if matches contradict the motion (``lasting``), since their common error may have
    caused it: a lamp mirrored in a polished wall made radii 0.3 mm too large. It is also doubtful if the
    camera ``shakes`` or the probe does not fit, since the picture may have moved and not the probe: pictures
    shaken by 2 px at random made radii 0.06 mm too small. Distances get the same relative σ as the radius,
    because a wrong probe scales both equally.
    """
    if trajectory.instrument is None or trajectory.instrument_covariance is None:
        return trajectory
    found = contradiction(trajectory, probe)
    if not (shakes or lasting > MOST_LASTING or found.of_probe):
        return trajectory
    wider = _wider_by(found.moved, probe, trajectory.radius_mm)
    way = np.zeros((len(trajectory.T_pc), 6))
    way[:, :3] = wider * (trajectory.T_pc[:, :3, 3] - trajectory.T_pc[0, :3, 3])
    length_mm = float(np.ptp(distance_along(trajectory.axis, trajectory.T_pc)))
    return replace(
        trajectory,
        covariance=trajectory.covariance + way[:, :, None] * way[:, None, :],
        distance_sigma_mm=float(np.hypot(trajectory.distance_sigma_mm, wider * length_mm)),
        instrument_covariance=trajectory.instrument_covariance + np.outer(found.moved, found.moved),
    )


def scale_sigma_of(probe: Probe, radius_mm: float) -> float:
    """Return the relative 1 σ of radii and distances by the σ of a probe, which scales both alike."""
    return float(np.linalg.norm([_wider_by(u, probe, radius_mm) for u in probe.principal_uncertainties().T]))


def _wider_by(moved: Float, probe: Probe, radius_mm: float) -> float:
    """Return the relative change of the pipe's measured radius if a probe's parameters are ``moved`` (P,)."""
    psi = np.linspace(-np.pi, np.pi, _RING, endpoint=False)
    ring = np.stack([radius_mm * np.cos(psi), radius_mm * np.sin(psi), 0 * psi + probe.laser.baseline_mm], -1)
    uv, found = (
        probe.camera.project(ring).uv,
        probe.with_parameters(probe.parameters + moved, probe.covariance),
    )
    stated, with_it = (np.nanmean(np.linalg.norm(p.triangulate(uv)[:, :2], axis=1)) for p in (probe, found))
    return float(with_it / stated - 1)


def report_instrument(probe: Probe, trajectory: Trajectory, context: Context) -> None:
    """Report how far pictures and stated probe contradict each other; warn if not both can be right."""
    if trajectory.instrument is None:
        return
    found = contradiction(trajectory, probe)
    context.report("contradiction of pictures and stated probe, at most", found.sigmas, "σ")
    if found.of_probe:
        context.warn(
            f"the stated probe does not fit this recording: it had to be moved by {found.farthest:.0f} times "
            f"its stated σ, most of all {_most(found.moved, probe)}; radii and distances may be wrong by "
            f"more than their σ. {_remedy(probe, trajectory)}"
        )
    elif found.certain:
        context.warn(
            f"pictures and stated probe contradict each other by {found.sigmas:.0f} σ: by the pictures alone "
            f"the probe would change, most of all {_demanded(found, trajectory, probe)}. Either the pictures "
            "were shifted, cropped or scaled after the calibration, or dust, reflections or water that move "
            f"with the probe were taken for the wall. Nothing is corrected: {_consequence(trajectory)}. "
            "What to do: compare the pictures with those of the calibration, clean and dry the window, run "
            "boresight diagnose on a gauge run"
        )


def _demanded(found: Contradiction, trajectory: Trajectory, probe: Probe) -> str:
    """Return what the pictures demand of the probe; they may not tell several answers apart."""
    changes = [r.instrument - probe.parameters for r in trajectory.rivals] or [found.wanted]
    return ", or ".join(_most(change, probe) for change in changes)


def _consequence(trajectory: Trajectory) -> str:
    if not trajectory.rivals:
        return "radii, distances and roll may be wrong by more than their σ"
    return "σ of radii and distances includes what such a probe would change, σ of roll does not"


def _most(change: Float, probe: Probe) -> str:
    """Return the parameter whose change is largest in stated σ, with its change."""
    sigma = np.sqrt(np.diagonal(probe.covariance))
    most = int(np.argmax(np.divide(np.abs(change), sigma, out=np.zeros_like(change), where=sigma > 0)))
    return f"{probe.parameter_names[most]} by {change[most]:+.3g}"


def _remedy(probe: Probe, trajectory: Trajectory) -> str:
    """Return what to do about a probe that does not fit."""
    if way := mirrored_way(probe, trajectory):
        return (
            f"It fits pictures that are {way}; clock positions are then {way} as well. What to do: switch "
            "this off in camera and recorder, or undo it in the pictures, and run again"
        )
    return "What to do: run boresight diagnose, or calibrate the probe again"
