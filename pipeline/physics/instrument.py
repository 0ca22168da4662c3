"""Known effects of the instrument: laser sheet, camera, windows and media."""

from __future__ import annotations

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity

DIRECTION = Quantity("direction_deg", "deg", 40.0, -360.0, 360.0, "azimuth in C of the effect's crest")

LASER_EFFECTS = (
    Effect(
        "laser_tilt", "laser",
        (Quantity("tilt_deg", "deg", 0.05, 0.0, 3.0, "angle by which the sheet leans forward"), DIRECTION),
        1, 2.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −r x / (1 + x), x = (r/l) tan φ cos(ψ − ψ₀)", 0.102,
        ("principal_point", "sensor_tilt"),
        "an off-centre sweep of 8 mm or more, bores of several diameters, the faint line that bounces across "
        "the bore",
    ),
    Effect(
        "laser_cone", "laser",
        (Quantity("cone_deg", "deg", 0.05, -3.0, 3.0, "elevation of the sheet all round, forward positive"),),
        0, 2.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r²/l) tan ε₀", 0.102,
        ("focal_scale", "pupil_shift", "dome_axial"),
        "bores of several diameters, the faint line that bounces across the bore",
    ),
    Effect(
        "baseline", "laser",
        (Quantity("baseline_mm", "mm", 0.05, -2.0, 2.0, "distance of the sheet beyond the stated"),),
        0, 1.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r/l) δl", 0.115,
        ("outside_index", "vignetting", "encoder_scale"),
        "a bore of known diameter, or a run with a trusted encoder and much texture",
    ),
    Effect(
        "beam_decentre", "laser",
        (Quantity("height_mm", "mm", 0.05, 0.0, 1.0, "amplitude of the sheet's height"), DIRECTION),
        1, 1.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r/l) h cos(ψ − ψ₀)", 0.115,
        ("dome_lateral",),
        "a run whose poses are known from fiducials; the line's brightness around the ring",
    ),
    Effect(
        "sheet_waviness", "laser",
        (
            Quantity("amplitude_mrad", "mrad", 0.3, 0.0, 10.0, "amplitude of the sheet's elevation"),
            Quantity("order", "", 2.0, 2.0, 6.0, "waves around the ring"),
            DIRECTION,
        ),
        2, 2.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r²/l) ε_m cos m(ψ − ψ_m)", 0.035,
        ("pixel_aspect",),
        "a run with roll (against ovality), bores of several diameters (against pixel aspect)",
    ),
    Effect(
        "laser_rocking", "laser",
        (
            Quantity("amplitude_mrad", "mrad", 1.0, 0.0, 20.0, "amplitude of the sheet's tilt"),
            Quantity("frequency_hz", "Hz", 5.3, 0.05, 200.0, "frequency of the rocking"),
            DIRECTION,
        ),
        1, 2.00, FixedTo.LASER, Channel.RING, "periodic",
        "δr = −(r²/l) φ sin(2πft) cos(ψ − ψ₀)", 0.117,
        ("probe_vibration",),
        "bores of several diameters, a wall with texture (a vibrating probe moves it, a rocking sheet not)",
    ),
)  # fmt: skip


_TIME = Quantity("time_s", "s", 40.0, 0.5, 1e5, "time constant t₀ of 1 − exp(−t/t₀)")

CAMERA_EFFECTS = (
    Effect(
        "principal_point", "camera",
        (Quantity("shift_px", "px", 0.5, 0.0, 20.0, "shift of the optical axis in the image"), DIRECTION),
        1, 1.44, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (l + r²/l)(c/f) cos(ψ − ψ₀)", 0.194,
        ("laser_tilt", "sensor_tilt"),
        "a run whose poses are known from fiducials, a wall with texture (focus of expansion), the faint "
        "line that bounces across the bore",
    ),
    Effect(
        "focal_scale", "camera",
        (Quantity("relative", "", 1e-3, -0.05, 0.05, "true over stated focal length, less one"),),
        0, 1.88, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S κ θ", 0.162,
        ("laser_cone", "pupil_shift", "dome_axial"), "bores of several diameters, a wall with texture",
    ),
    Effect(
        "radial_distortion", "camera",
        (Quantity("k", "", 1e-3, -0.05, 0.05, "coefficient of θ³ beyond the stated"),),
        0, 2.76, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S k θ³", 0.219,
        ("laser_cone", "focal_scale"), "bores with a long range of radii, a wall with texture",
    ),
    Effect(
        "sensor_tilt", "camera",
        (Quantity("p", "", 1e-3, 0.0, 0.02, "decentring p₂: shift 3 f p₂ θ² on the axis"), DIRECTION),
        1, 2.32, FixedTo.CAMERA, Channel.RING, "static",
        "δr = 3 S p₂ θ² cos(ψ − ψ₀)", 0.564,
        ("laser_tilt", "principal_point"), "bores of several diameters, a wall with texture",
    ),
    Effect(
        "pixel_aspect", "camera",
        (Quantity("relative", "", 1e-3, -0.02, 0.02, "true over stated ratio of pixel sides, less one"),),
        2, 1.88, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (a/2) θ cos 2ψ", 0.081,
        ("sheet_waviness", "ovality"), "a run with roll, bores of several diameters, a wall with texture",
    ),
    Effect(
        "pupil_shift", "camera",
        (Quantity("shift_mm", "mm", 0.5, -5.0, 5.0, "ε of the entrance pupil's way E = ε (θ/sin θ − 1)"),),
        0, 1.99, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (r/l) ε (θ/sin θ − 1)", 0.309,
        ("laser_cone", "focal_scale", "dome_axial"),
        "bores of several diameters, a wall with texture at several distances",
    ),
    Effect(
        "rolling_shutter", "camera",
        (Quantity("readout_s", "s", 0.016, 0.0, 0.1, "time from first to last row"),),
        2, None, FixedTo.CAMERA, Channel.RING, "speed",
        "δr = (ė_x τ/2) sin 2ψ, (ė_y τ/2)(1 − cos 2ψ), τ = readout ρ₀/H", 0.02,
        ("ovality", "laser_tilt"), "a run with vibration, a run with changes of speed",
    ),
    Effect(
        "motion_blur", "camera",
        (Quantity("exposure_s", "s", 0.01, 0.0, 0.1, "exposure beyond the stated"),),
        2, None, FixedTo.CAMERA, Channel.PROFILE, "speed",
        "width² grows by (ė t)² cos²ψ / 12; the centroid lags by t/2", 0.06,
        ("time_offset",), "runs at several speeds (line and texture widen with it)",
    ),
    Effect(
        "baseline_drift", "camera",
        (Quantity("drift_mm", "mm", 0.05, -1.0, 1.0, "final change of the baseline"), _TIME),
        0, 1.00, FixedTo.TIME, Channel.RING, "drift",
        "δr = −(r/l) δl (1 − exp(−t/t₀))", 0.023,
        ("focal_drift",),
        "a run in which the probe stands still for a while, bores of several diameters, a second pass of the "
        "same wall (against a taper of the pipe)",
    ),
    Effect(
        "focal_drift", "camera",
        (Quantity("relative", "", 1e-3, -0.02, 0.02, "final relative change of the focal length"), _TIME),
        0, 1.88, FixedTo.TIME, Channel.RING, "drift",
        "δr = S κ θ (1 − exp(−t/t₀))", 0.16,
        ("baseline_drift",),
        "a run in which the probe stands still for a while, bores of several diameters, a wall with texture, "
        "a second pass of the same wall",
    ),
    Effect(
        "centre_drift", "camera",
        (Quantity("shift_px", "px", 0.5, 0.0, 20.0, "final shift of the optical axis"), DIRECTION, _TIME),
        1, 1.44, FixedTo.TIME, Channel.RING, "drift",
        "δr = (l + r²/l)(c/f) cos(ψ − ψ₀)(1 − exp(−t/t₀))", 0.194,
        ("laser_tilt", "principal_point"),
        "a run whose poses are known from fiducials, a wall with texture, a second pass of the same wall",
    ),
    Effect(
        "pixel_locking", "camera",
        (Quantity("amplitude_px", "px", 0.02, 0.0, 0.3, "amplitude a of a sin 2πρ"),),
        None, None, FixedTo.CAMERA, Channel.RING, "static",
        "δρ = a sin 2πρ", 0.008,
        (), "rings of many radii (the error follows the fraction of a pixel)",
    ),
)  # fmt: skip


# The dome of the catalogue's typical figures; only the product (n − 1) t / (n ρ²) has an effect.
GLASS_INDEX, DOME_THICKNESS_MM, DOME_RADIUS_MM = 1.5, 2.0, 14.0
DOME_POWER = (GLASS_INDEX - 1) * DOME_THICKNESS_MM / (GLASS_INDEX * DOME_RADIUS_MM**2)
# A tube that nobody stated: 30 mm outside and 2 mm thick, the typical size of `housing_glass` below. The
# simulator, the error budget and the diagnosis suppose the same.
TUBE_OUTER_RADIUS_MM, TUBE_THICKNESS_MM = 15.0, 2.0

WINDOW_EFFECTS = (
    Effect(
        "housing_glass", "window",
        (Quantity("thickness_mm", "mm", 2.0, 0.0, 10.0, "thickness of a coaxial glass tube of index 1.5"),),
        0, -0.29, FixedTo.CAMERA, Channel.RING, "static",
        "δr = −t (1 − tan i′/tan i), tan i = l/r, sin i′ = sin i / n", -0.74,
        ("baseline",), "bores of known diameters",
    ),
    Effect(
        "tube_wedge", "window",
        (Quantity("wedge_mm", "mm", 0.05, 0.0, 2.0, "amplitude of the tube's thickness"), DIRECTION),
        1, -0.27, FixedTo.CAMERA, Channel.RING, "static",
        "δr = −δt (1 − tan i′/tan i) cos(ψ − ψ₀)", 0.018,
        ("beam_decentre",), "a wall with texture (which gives the pose)",
    ),
    Effect(
        "tube_tilt", "window",
        (Quantity("tilt_deg", "deg", 1.0, 0.0, 10.0, "tilt of a coaxial glass tube 2 mm thick"), DIRECTION),
        1, 0.26, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (d′(i)/sin i − (r/l) t (1 − 1/n)) χ cos(ψ − ψ₀), sin i = cos θ; exponent and size: first part",
        0.035,
        ("dome_lateral",), "a wall with texture (which gives the pose), bores of several diameters",
    ),
    Effect(
        "dome_axial", "window",
        (Quantity("offset_mm", "mm", 0.5, -5.0, 5.0, "axial offset of a glass dome, 2 mm, radius 14 mm"),),
        0, 1.72, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (n−1) t d sin θ / (n ρ²)", 0.217,
        ("focal_scale", "laser_cone", "pupil_shift"), "bores of several diameters",
    ),
    Effect(
        "dome_lateral", "window",
        (Quantity("offset_mm", "mm", 0.3, 0.0, 5.0, "lateral offset of that dome"), DIRECTION),
        1, 0.72, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (n−1) t d cos θ / (n ρ²) cos(ψ − ψ₀)", 0.057,
        ("beam_decentre", "principal_point"), "bores of several diameters, a wall with texture",
    ),
    Effect(
        "outside_index", "window",
        (Quantity("index_excess", "", 2.7e-4, -0.01, 0.4, "index of the medium less one; sealed probe"),),
        0, 1.22, FixedTo.PIPE, Channel.RING, "static",
        "δr = −(r − r_t) δn / sin²θ; water needs Snell's law in full", 0.012,
        ("baseline", "vignetting"), "a log of pressure and temperature",
    ),
)  # fmt: skip
