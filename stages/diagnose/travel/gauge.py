"""Travel through a gauge: poses by fiducials and known bore, compared with the encoder."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Bool
from pipeline.recording.base import Recording
from stages.calibrate.gauge.calibrate import MeasuredRun
from stages.calibrate.gauge.state import Unknowns
from stages.diagnose.travel.evidence import TravelEvidence, travel_evidence
from stages.diagnose.travel.sight import sight_of_poses

_PLACEMENT_SIGMA_MM = 0.05
_MOST_OF_RING = 0.5


def gauge_travel(recording: Recording, run: MeasuredRun, state: Unknowns) -> TravelEvidence:
    """Return what motion and encoder of a gauge run say.

    Only frames with fiducials count: these place the camera to a few µm, so that the encoder, loosely
    weighted in the adjustment, has no say there. The scale is that of the fiducials' stated places.

    Parameters
    ----------
    run
        The measured run.
    state
        The adjusted state, as of `stages.diagnose.gauge.prepare.prepare`.
    """
    fiducials = recording.pipe.fiducials
    # Markers of one row were put there together and err alike: rows count, not markers.
    places = np.unique([round(m.distance_mm, 1) for m in fiducials.markers]) if fiducials else np.zeros(1)
    spread = float(np.sqrt(np.sum((places - places.mean()) ** 2)))
    sight = sight_of_poses(recording, state.T_pc, run.posed, _PLACEMENT_SIGMA_MM / max(spread, 1.0))
    span = slice(int(run.posed[0]), int(run.posed[-1]) + 1)
    return travel_evidence(
        "gauge", recording, sight, state.T_pc[span], state.stated.encoder_scale_sigma, _shown(run)[span]
    )


def _shown(run: MeasuredRun) -> Bool:
    """Return the frames (N,) placed by fiducials or most of a ring; others only lie between neighbours."""
    count = np.bincount(run.measured.rings.frame, minlength=len(run.measured.time_s))
    shown = count > _MOST_OF_RING * np.max(count, initial=1)
    shown[run.posed] = True
    return np.asarray(shown)
