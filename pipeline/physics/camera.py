"""Effects of the camera."""

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity
from pipeline.physics.laser import DIRECTION

_TIME = Quantity("time_s", "s", 40.0, 0.5, 1e5, "time constant t₀ of 1 − exp(−t/t₀)")

CAMERA_EFFECTS = (
    Effect(
        "principal_point", "camera",
        (Quantity("shift_px", "px", 0.5, 0.0, 20.0, "shift of the optical axis in the image"), DIRECTION),
        1, 1.44, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (l + r²/l)(c/f) cos(ψ − ψ₀)", 0.194,
        ("laser_tilt", "sensor_tilt"), "known pose, texture (focus of expansion), the ghost across the bore",
    ),
    Effect(
        "focal_scale", "camera",
        (Quantity("relative", "", 1e-3, -0.05, 0.05, "true over stated focal length, less one"),),
        0, 1.88, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S κ θ", 0.162,
        ("laser_cone", "pupil_shift", "dome_axial"), "several diameters, texture",
    ),
    Effect(
        "radial_distortion", "camera",
        (Quantity("k", "", 1e-3, -0.05, 0.05, "coefficient of θ³ beyond the stated"),),
        0, 2.76, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S k θ³", 0.219,
        ("laser_cone", "focal_scale"), "a long range of radius, texture",
    ),
    Effect(
        "sensor_tilt", "camera",
        (Quantity("p", "", 1e-3, 0.0, 0.02, "decentring p₂: shift 3 f p₂ θ² on the axis"), DIRECTION),
        1, 2.32, FixedTo.CAMERA, Channel.RING, "static",
        "δr = 3 S p₂ θ² cos(ψ − ψ₀)", 0.564,
        ("laser_tilt", "principal_point"), "several diameters, texture",
    ),
    Effect(
        "pixel_aspect", "camera",
        (Quantity("relative", "", 1e-3, -0.02, 0.02, "true over stated ratio of pixel sides, less one"),),
        2, 1.88, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (a/2) θ cos 2ψ", 0.081,
        ("sheet_waviness", "ovality"), "roll, several diameters, texture",
    ),
    Effect(
        "pupil_shift", "camera",
        (Quantity("shift_mm", "mm", 0.5, -5.0, 5.0, "ε of the entrance pupil's way E = ε (θ/sin θ − 1)"),),
        0, 1.99, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (r/l) ε (θ/sin θ − 1)", 0.309,
        ("laser_cone", "focal_scale", "dome_axial"), "several diameters, texture at several distances",
    ),
    Effect(
        "rolling_shutter", "camera",
        (Quantity("readout_s", "s", 0.016, 0.0, 0.1, "time from first to last row"),),
        2, None, FixedTo.CAMERA, Channel.RING, "speed",
        "δr = (ė_x τ/2) sin 2ψ, (ė_y τ/2)(1 − cos 2ψ), τ = readout ρ₀/H", 0.02,
        ("ovality", "laser_tilt"), "vibration, changes of speed",
    ),
    Effect(
        "motion_blur", "camera",
        (Quantity("exposure_s", "s", 0.01, 0.0, 0.1, "exposure beyond the stated"),),
        2, None, FixedTo.CAMERA, Channel.PROFILE, "speed",
        "width² grows by (ė t)² cos²ψ / 12; the centroid lags by t/2", 0.06,
        ("time_offset",), "the width of line and texture against speed",
    ),
    Effect(
        "baseline_drift", "camera",
        (Quantity("drift_mm", "mm", 0.05, -1.0, 1.0, "final change of the baseline"), _TIME),
        0, 1.00, FixedTo.TIME, Channel.RING, "drift",
        "δr = −(r/l) δl (1 − exp(−t/t₀))", 0.023,
        ("focal_drift",), "a dwell, several diameters, a second pass (against a taper of the pipe)",
    ),
    Effect(
        "focal_drift", "camera",
        (Quantity("relative", "", 1e-3, -0.02, 0.02, "final relative change of the focal length"), _TIME),
        0, 1.88, FixedTo.TIME, Channel.RING, "drift",
        "δr = S κ θ (1 − exp(−t/t₀))", 0.16,
        ("baseline_drift",), "a dwell, several diameters, texture, a second pass",
    ),
    Effect(
        "centre_drift", "camera",
        (Quantity("shift_px", "px", 0.5, 0.0, 20.0, "final shift of the optical axis"), DIRECTION, _TIME),
        1, 1.44, FixedTo.TIME, Channel.RING, "drift",
        "δr = (l + r²/l)(c/f) cos(ψ − ψ₀)(1 − exp(−t/t₀))", 0.194,
        ("laser_tilt", "principal_point"), "known pose, texture, a second pass",
    ),
    Effect(
        "pixel_locking", "camera",
        (Quantity("amplitude_px", "px", 0.02, 0.0, 0.3, "amplitude a of a sin 2πρ"),),
        None, None, FixedTo.CAMERA, Channel.RING, "static",
        "δρ = a sin 2πρ", 0.008,
        (), "stacking on the pixel's phase",
    ),
)  # fmt: skip
