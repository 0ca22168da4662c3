"""Parameters of the motion stage."""

from __future__ import annotations

from pydantic import Field

from pipeline.machine.stage import Parameters


class MotionParameters(Parameters):
    """Parameters of the motion stage; every default is meant for 2 to 4 inch pipe.

    The defaults were chosen on the open recordings and on drawn runs. The sensitivity of the results to them
    was not measured; if a default follows from something, a comment says so.
    """

    # A patch of 21 samples is 4.6 mm of wall.
    strip_step_mm: float = Field(
        0.22, gt=0.02, le=5, description="sample spacing, mm, of the strips in which texture is tracked"
    )
    # Beyond 72° matches of one rendered scene of 640 x 480 pixels are biased by up to 0.65 px.
    near_angle_deg: float = Field(
        78.0, gt=45, le=110, description="largest polar angle, deg, at which wall texture is tracked"
    )
    far_angle_deg: float = Field(
        38.0, ge=10, lt=45, description="smallest polar angle, deg, at which wall texture is tracked"
    )
    patch_half_px: int = Field(10, ge=4, le=30, description="half size, strip samples, of a tracked patch")
    # A little more than a patch, so that neighbouring patches share few samples.
    cell_px: int = Field(
        24, ge=10, le=200, description="size of a cell, strip samples, in which one landmark is kept"
    )
    min_correlation: float = Field(
        0.35, ge=0.2, le=0.99, description="normalised cross-correlation below which a match is refused"
    )
    landmark_sigma_px: float = Field(
        0.3,
        gt=0,
        le=2,
        description="predicted 1 σ of a match, strip samples, above which a patch is not used",
    )
    # 5°, the 72nd part of the circle, is finer than the ovality that the pipe's model has.
    ring_bins: int = Field(72, ge=12, le=720, description="azimuth bins into which a ring is condensed")
    surface_sigma_mm: float = Field(
        0.10, gt=0, le=5, description="1 σ, mm, of the wall around the smooth pipe, at landmarks and rings"
    )
    axis_knot_mm: float = Field(30.0, ge=5, le=500, description="spacing, mm, of the axis' spline knots")
    axis_bend_sigma: float = Field(
        2e-3, gt=0, le=0.1, description="1 σ, 1/mm, of the change of the axis' curvature from knot to knot"
    )
    encoder_sigma_mm: float = Field(
        0.005,
        gt=0,
        le=10,
        description="1 σ, mm, of an encoder reading in addition to its quantisation, which is measured",
    )
    encoder_slip_sigma_mm: float = Field(
        0.002,
        gt=0,
        le=1,
        description="1 σ, mm, of the encoder's creep from frame to frame; slips may be far larger",
    )
    # Nearly as many as are kept (`most_observations`): a landmark counts little more than one observation.
    alike: float = Field(
        15.0,
        ge=1,
        le=10000,
        description="number of neighbouring observations of a landmark that have the same error",
    )
    most_observations: int = Field(
        16, ge=3, le=1000, description="most observations of one landmark that enter the adjustment"
    )
    # Compared with a probe calibrated on a gauge, matches of open-1-field err by up to 0.05 px. If matches of
    # a recording disagree by more, a larger shared error is assumed (`with_shared_error`).
    match_bias_px: float = Field(
        0.1,
        gt=0,
        le=2,
        description="least 1 σ, px, of the radial error that matches near one polar angle share",
    )
    turn_sigma_rad: float = Field(
        0.1, gt=0, le=1, description="1 σ, rad, of a rotation from frame to frame where no texture shows it"
    )
    iterations: int = Field(200, ge=2, le=1000, description="most steps of the adjustment of a window")
    max_track_frames: int = Field(
        240, ge=20, le=2000, description="largest number of frames through which one landmark is followed"
    )
    window_frames: int = Field(
        800, ge=40, le=20000, description="frames adjusted jointly; a longer run is cut in such windows"
    )
    overlap_frames: int = Field(
        200, ge=10, le=10000, description="frames that neighbouring windows share at least"
    )
    loop_spacing_mm: float = Field(
        100.0,
        ge=10,
        le=100000,
        description="spacing, mm, of places at which a wall passed again is compared",
    )
    most_loops: int = Field(
        100,
        ge=0,
        le=1000,
        description="largest number of places at which a wall passed again is compared; 0: no loops",
    )

    @property
    def patch_size(self) -> int:
        """Return the size of a tracked patch, strip samples."""
        return 2 * self.patch_half_px + 1
