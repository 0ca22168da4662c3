"""Parameters of laser plane calibration."""

from __future__ import annotations

from pydantic import Field

from pipeline.machine.stage import Parameters


class LaserPlaneParameters(Parameters):
    """Where the laser line is looked for, what counts as line, and what makes pictures unfit."""

    wavelength_nm: float = Field(default=520.0, ge=380, le=750, description="wavelength of the laser, nm")
    margin_squares: float = Field(
        default=1.0,
        ge=0,
        le=50,
        description="how far beyond the outermost corners found the board is still flat, squares",
    )
    huber_px: float = Field(
        default=1.0, gt=0, le=20, description="residual beyond which a corner counts linearly, px"
    )
    largest_pose_rms_px: float = Field(
        default=1.0, gt=0, le=20, description="boards whose corners fit the camera worse are not used, px"
    )
    window_px: float = Field(
        default=6.0, ge=3, le=50, description="half width of the profile across the line, px"
    )
    least_contrast: float = Field(
        default=6.0, ge=2, le=100, description="height of the line above the noise, in 1 σ of the noise"
    )
    least_points: int = Field(
        default=40, ge=10, le=100000, description="a line seen at fewer places is not used"
    )
    least_pictures: int = Field(
        default=3, ge=2, le=1000, description="fewer pictures with a line are refused"
    )
    least_spread: float = Field(
        default=0.05,
        gt=0,
        le=1,
        description="lines that spread less across their common direction, as a share of along, are refused",
    )
    largest_tilt_sigma_deg: float = Field(
        default=0.5, gt=0, le=10, description="a larger 1 σ of the plane's direction is refused, deg"
    )
