"""Parameters of the gauge calibration, and the unknowns of its adjustment with their priors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from pydantic import Field

from pipeline.arrays import Float
from pipeline.geometry.rigid import from_parts, rotation_from_vector
from pipeline.instrument.laser import LaserSheet
from pipeline.instrument.probe import Probe
from pipeline.machine.stage import Parameters

ENCODER = 3
OFFSET_SIGMA_MM = 1.0
"""1 σ, mm, of the encoder's offset that first poses give. They rest on corners of fiducials, found to about a
pixel, which is less than this on any gauge's wall. Where borders across the gauge are too narrow to be
measured, nothing else holds the distance, and poses left the gauge by metres."""


class GaugeParameters(Parameters):
    """Parameters of the gauge calibration.

    The laser's priors are wide on purpose: a gauge run should find a misaligned sheet, which the stated
    uncertainty would suppress. The camera's priors are its stated uncertainties times a factor.
    """

    baseline_prior_mm: float = Field(1.0, gt=0, le=20, description="prior 1 σ, mm, of the baseline")
    tilt_prior_deg: float = Field(2.0, gt=0, le=20, description="prior 1 σ, deg, of each tilt of the sheet")
    cone_prior_deg: float = Field(1.0, gt=0, le=20, description="prior 1 σ, deg, of the sheet's elevation")
    decentre_prior_mm: float = Field(
        0.5,
        gt=0,
        le=5,
        description="prior 1 σ, mm, of the sheet's decentring, if the data require it",
    )
    waviness_prior_rad: float = Field(
        0.002, gt=0, le=0.05, description="prior 1 σ, rad, of each wave of the sheet, if the data require it"
    )
    camera_prior_scale: float = Field(
        1.0, ge=1, le=1000, description="factor on the camera's stated uncertainty in its prior"
    )
    placement_sigma_mm: float = Field(0.05, gt=0, le=5, description="1 σ, mm, of a fiducial's place")
    delay_prior_s: float = Field(0.05, gt=0, le=1, description="prior 1 σ, s, of the encoder's delay")
    encoder_sigma_mm: float = Field(0.1, gt=0, le=10, description="1 σ, mm, of an encoder reading")
    encoder_slip_sigma_mm: float = Field(
        0.02, gt=0, le=1, description="1 σ, mm, of the encoder's slip from one frame to the next"
    )
    edge_samples: int = Field(4, ge=3, le=50, description="profiles measured across each edge of a fiducial")
    edge_half_px: float = Field(4.0, ge=2, le=20, description="half length, px, of a profile across an edge")
    least_border_px: float = Field(
        5.0, ge=1, le=50, description="a fiducial's border narrower than this, px, blurs into its pattern"
    )
    ring_bins: int = Field(240, ge=36, le=1440, description="azimuth bins into which a ring is condensed")
    step_margin_mm: float = Field(
        2.5, ge=0, le=20, description="rings nearer than this, mm, to a step of the bore are left out"
    )
    fiducial_margin_mm: float = Field(
        1.0, ge=0, le=20, description="rings nearer than this, mm, to an edge of a fiducial are left out"
    )
    least_posed_frames: int = Field(
        12, ge=4, le=10000, description="fewest frames in which fiducials must give the pose"
    )
    least_ring_frames: int = Field(12, ge=4, le=10000, description="fewest rings on known bore")
    least_offset_mm: float = Field(
        1.0, ge=0, le=100, description="least r.m.s. distance, mm, of the camera from the gauge's axis"
    )
    largest_radius_sigma_mm: float = Field(
        0.05, gt=0, le=10,
        description="largest 1 σ, mm, that the result may leave in the radius of the gauge's widest bore",
    )  # fmt: skip
    evidence: float = Field(
        25.0, ge=0, le=1e6,
        description="drop of χ², beyond ln n for each parameter, from which decentring or waviness is used",
    )  # fmt: skip
    iterations: int = Field(12, ge=3, le=100, description="most Gauss-Newton steps of each adjustment")


class SheetModel(StrEnum):
    """Models of the laser sheet."""

    PLAIN = "baseline, tilt and cone"
    DECENTRED = "baseline, tilt, cone and decentring"
    WAVY = "baseline, tilt, cone and waviness"
    DECENTRED_WAVY = "baseline, tilt, cone, decentring and waviness"


@dataclass(frozen=True)
class Layout:
    """Indices of the global unknowns in the border.

    First the encoder's scale, offset and delay, then the radii of the bores, then the shift of each
    fiducial's four edges, then the instrument.
    """

    bores: int
    markers: int
    instrument_size: int

    @property
    def size(self) -> int:
        """Number of global unknowns."""
        return ENCODER + self.bores + 4 * self.markers + self.instrument_size

    @property
    def bore(self) -> slice:
        """Radii of the bores."""
        return slice(ENCODER, ENCODER + self.bores)

    @property
    def marker(self) -> slice:
        """Outward shifts of the fiducials' edges, four for each."""
        return slice(self.bore.stop, self.bore.stop + 4 * self.markers)

    @property
    def instrument(self) -> slice:
        """Corrections of the instrument."""
        return slice(self.size - self.instrument_size, self.size)


@dataclass(frozen=True)
class Unknowns:
    """The unknowns of the adjustment.

    Attributes
    ----------
    T_pc : (N, 4, 4)
        Pose of every frame.
    slip : (N,)
        Encoder's accumulated slip, mm.
    encoder : (3,)
        Scale, offset in mm, and delay in s.
    bore_mm : (S,)
        Corrections of the bores' radii.
    edge_mm : (K, 4)
        Outward shift of each edge of each fiducial along the wall.
    instrument : (Q,)
        Corrections in units of their prior σ.
    stated : Probe
    unsure : (P, Q)
        Change of the probe's parameters with each correction.
    first_offset_mm : float
        The encoder's offset by the first poses, ± `OFFSET_SIGMA_MM`.
    """

    T_pc: Float
    slip: Float
    encoder: Float
    bore_mm: Float
    edge_mm: Float
    instrument: Float
    stated: Probe
    unsure: Float
    first_offset_mm: float

    @property
    def layout(self) -> Layout:
        """Indices of the global unknowns."""
        return Layout(len(self.bore_mm), len(self.edge_mm), len(self.instrument))

    @property
    def border_size(self) -> int:
        """Number of global unknowns."""
        return self.layout.size

    @property
    def probe(self) -> Probe:
        """The probe with the corrections found so far."""
        parameters = self.stated.parameters + self.unsure @ self.instrument
        return self.stated.with_parameters(parameters, self.stated.covariance)

    def step(self, frames: Float, border: Float) -> Unknowns:
        """Return the state after a step of the frames (N, 7) and of the border (B,)."""
        at = self.layout
        turned = self.T_pc[:, :3, :3] @ rotation_from_vector(frames[:, 3:6])
        return replace(
            self,
            T_pc=from_parts(turned, self.T_pc[:, :3, 3] + frames[:, :3]),
            slip=self.slip + frames[:, 6],
            encoder=self.encoder + border[:ENCODER],
            bore_mm=self.bore_mm + border[at.bore],
            edge_mm=self.edge_mm + border[at.marker].reshape(-1, 4),
            instrument=self.instrument + border[at.instrument],
        )


def prior_directions(probe: Probe, model: SheetModel, parameters: GaugeParameters) -> Float:
    """Return (P, Q) one prior σ of each correction: the camera's as stated, the sheet's wide."""
    split = len(probe.camera.parameter_names)
    camera = replace(probe, covariance=_only(probe.covariance, split)).principal_uncertainties()
    degree = np.radians(1.0)
    sigma = {
        "baseline_mm": parameters.baseline_prior_mm,
        "tilt_x": parameters.tilt_prior_deg * degree,
        "tilt_y": parameters.tilt_prior_deg * degree,
        "cone_rad": parameters.cone_prior_deg * degree,
    }
    if model in (SheetModel.DECENTRED, SheetModel.DECENTRED_WAVY):
        sigma |= dict.fromkeys(LaserSheet.PARAMETER_NAMES[4:6], parameters.decentre_prior_mm)
    if model in (SheetModel.WAVY, SheetModel.DECENTRED_WAVY):
        sigma |= dict.fromkeys(LaserSheet.PARAMETER_NAMES[6:], parameters.waviness_prior_rad)
    names = probe.parameter_names
    sheet = np.zeros((len(names), len(sigma)))
    for k, (name, value) in enumerate(sigma.items()):
        sheet[names.index(name), k] = value
    return np.concatenate([parameters.camera_prior_scale * camera, sheet], 1)


def _only(covariance: Float, count: int) -> Float:
    """Return a covariance of the first ``count`` parameters, the others exact."""
    out = np.zeros_like(covariance)
    out[:count, :count] = covariance[:count, :count]
    return out
