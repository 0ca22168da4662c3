"""Evidence of an inspection at the level of its linear equations, for tests."""

import numpy as np

from stages.diagnose.effects.library import LIBRARY
from stages.diagnose.field.evidence import FieldEvidence
from stages.diagnose.inference import Column, Evidence, Stated

NOTHING_STATED = Stated((), np.zeros((0, 0)))
AZIMUTH = np.linspace(-np.pi, np.pi, 400, endpoint=False)
WAVE = np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)], 1)
CONE = np.ones((400, 1))
SIGMA = 0.1


def field_with(signal):
    """Evidence of one diameter: tilt and principal point have the same pattern, a cone has another."""
    names = ("laser_tilt", "principal_point", "laser_cone")
    patterns = np.concatenate([2.0 * WAVE, 0.4 * WAVE, 2.0 * CONE], 1)
    columns = [Column(n, a.name) for n in names for a in LIBRARY[n].amplitudes]
    information = patterns.T @ patterns / SIGMA**2
    right = patterns.T @ signal / SIGMA**2
    misfit, degrees = float(signal @ signal) / SIGMA**2, np.full(len(right), np.inf)
    whole = Evidence(tuple(columns), information, right, information, misfit, degrees)
    return FieldEvidence(None, whole)
