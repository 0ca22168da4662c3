"""Effects of the laser sheet."""

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity

DIRECTION = Quantity("direction_deg", "deg", 40.0, -360.0, 360.0, "azimuth in C of the effect's crest")

LASER_EFFECTS = (
    Effect(
        "laser_tilt", "laser",
        (Quantity("tilt_deg", "deg", 0.05, 0.0, 3.0, "angle by which the sheet leans forward"), DIRECTION),
        1, 2.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −r x / (1 + x), x = (r/l) tan φ cos(ψ − ψ₀)", 0.102,
        ("principal_point", "sensor_tilt"),
        "an off-centre sweep of 8 mm or more, several diameters, the ghost across the bore",
    ),
    Effect(
        "laser_cone", "laser",
        (Quantity("cone_deg", "deg", 0.05, -3.0, 3.0, "elevation of the sheet all round, forward positive"),),
        0, 2.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r²/l) tan ε₀", 0.102,
        ("focal_scale", "pupil_shift", "dome_axial"), "several diameters, the ghost across the bore",
    ),
    Effect(
        "baseline", "laser",
        (Quantity("baseline_mm", "mm", 0.05, -2.0, 2.0, "distance of the sheet beyond the stated"),),
        0, 1.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r/l) δl", 0.115,
        ("outside_index", "vignetting", "encoder_scale"), "a known diameter, or trusted encoder and texture",
    ),
    Effect(
        "beam_decentre", "laser",
        (Quantity("height_mm", "mm", 0.05, 0.0, 1.0, "amplitude of the sheet's height"), DIRECTION),
        1, 1.00, FixedTo.LASER, Channel.RING, "static",
        "δr = −(r/l) h cos(ψ − ψ₀)", 0.115,
        ("dome_lateral",), "known pose; brightness of the line around the ring",
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
        ("pixel_aspect",), "roll (against ovality), several diameters (against pixel aspect)",
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
        ("probe_vibration",), "several diameters, texture that does not move along",
    ),
)  # fmt: skip
