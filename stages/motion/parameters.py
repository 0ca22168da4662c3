"""Parameters of the motion stage."""

from __future__ import annotations

from pydantic import Field

from pipeline.machine.stage import Parameters


class MotionParameters(Parameters):
    """What the motion stage lets the user choose; every default holds for 2 to 4 inch pipe."""

    strip_step_mm: float = Field(
        0.22, gt=0.02, le=5, description="sample spacing, mm, of the strips in which texture is tracked"
    )
    near_angle_deg: float = Field(
        78.0, gt=45, le=110, description="largest polar angle, deg, at which wall texture is tracked"
    )
    far_angle_deg: float = Field(
        38.0, ge=10, lt=45, description="smallest polar angle, deg, at which wall texture is tracked"
    )
    patch_half_px: int = Field(10, ge=4, le=30, description="half size, strip px, of a tracked patch")
    cell_px: int = Field(24, ge=10, le=200, description="one landmark is kept in each such cell, strip px")
    min_correlation: float = Field(
        0.35, ge=0.2, le=0.99, description="normalised cross-correlation below which a match is refused"
    )
    landmark_sigma_px: float = Field(
        0.3, gt=0, le=2, description="patches whose predicted match σ, strip px, is larger are not used"
    )
    ring_bins: int = Field(72, ge=12, le=720, description="azimuth bins into which a ring is condensed")
    surface_sigma_mm: float = Field(
        0.10, gt=0, le=5, description="1 σ, mm, of the wall about the smooth pipe, for landmarks"
    )
    axis_knot_mm: float = Field(30.0, ge=5, le=500, description="spacing, mm, of the axis' knots")
    axis_bend_sigma: float = Field(
        2e-3, gt=0, le=0.1, description="1 σ, 1/mm, of the change of the axis' curvature from knot to knot"
    )
    encoder_sigma_mm: float = Field(
        0.005,
        gt=0,
        le=10,
        description="1 σ, mm, of an encoder reading beside its quantisation, which is measured",
    )
    encoder_slip_sigma_mm: float = Field(
        0.002,
        gt=0,
        le=1,
        description="1 σ, mm, of the encoder's creep from frame to frame; slips may be far larger",
    )
    alike: float = Field(
        15.0, ge=1, le=10000, description="number of neighbouring observations of a landmark that err alike"
    )
    most_observations: int = Field(
        16, ge=3, le=1000, description="observations of one landmark that enter the adjustment"
    )
    match_bias_px: float = Field(
        0.1, gt=0, le=2, description="1 σ, px, by which texture matching may err alike all round the image"
    )
    turn_sigma_rad: float = Field(
        0.1, gt=0, le=1, description="1 σ, rad, of a turn from frame to frame where no texture shows it"
    )
    iterations: int = Field(60, ge=2, le=1000, description="most steps tried by the joint adjustment")
    max_track_frames: int = Field(
        240, ge=20, le=2000, description="longest span of frames, over which one landmark is followed"
    )
    window_frames: int = Field(
        800, ge=40, le=20000, description="frames adjusted jointly; a longer run is cut in windows of so many"
    )
    overlap_frames: int = Field(
        200, ge=10, le=10000, description="frames that neighbouring windows share at least"
    )
    loop_spacing_mm: float = Field(
        100.0,
        ge=10,
        le=100000,
        description="spacing, mm, of places at which a wall passed again is compared with what was seen",
    )
    most_loops: int = Field(
        100,
        ge=0,
        le=1000,
        description="most places in a run at which a wall passed again is compared; 0: none",
    )
