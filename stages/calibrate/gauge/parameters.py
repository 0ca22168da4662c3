"""Parameters of the gauge calibration."""

from __future__ import annotations

from pydantic import Field

from pipeline.machine.stage import Parameters


class GaugeParameters(Parameters):
    """What the gauge calibration lets the user choose.

    The laser's priors are wide on purpose: a misaligned sheet is what a gauge run is to find, so that the
    stated uncertainty must not hold it back. The camera's are the stated ones times a factor.
    """

    baseline_prior_mm: float = Field(1.0, gt=0, le=20, description="1 σ, mm, of the baseline beforehand")
    tilt_prior_deg: float = Field(
        2.0, gt=0, le=20, description="1 σ, deg, of each tilt of the sheet beforehand"
    )
    cone_prior_deg: float = Field(
        1.0, gt=0, le=20, description="1 σ, deg, of the sheet's elevation beforehand"
    )
    decentre_prior_mm: float = Field(
        0.5,
        gt=0,
        le=5,
        description="1 σ, mm, of the sheet's decentring beforehand, where the data ask for it",
    )
    waviness_prior_rad: float = Field(
        0.002, gt=0, le=0.05, description="1 σ, rad, of each wave of the sheet beforehand, where asked for"
    )
    camera_prior_scale: float = Field(
        1.0, ge=1, le=1000, description="factor on the camera's stated uncertainty beforehand"
    )
    placement_sigma_mm: float = Field(
        0.05, gt=0, le=5, description="1 σ, mm, by which a fiducial may be off its stated place"
    )
    delay_prior_s: float = Field(0.05, gt=0, le=1, description="1 σ, s, of the encoder's delay beforehand")
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
        description="drop of χ², beyond ln n for each parameter, for which decentring or waviness is taken",
    )  # fmt: skip
    iterations: int = Field(12, ge=3, le=100, description="most Gauss-Newton steps of each adjustment")
