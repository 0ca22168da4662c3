"""Effects of windows and media between probe and wall."""

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity
from pipeline.physics.laser import DIRECTION

# The dome of the typical figures: index 1.5, thickness 2 mm, radius 14 mm; only their product shows.
GLASS_INDEX, DOME_THICKNESS_MM, DOME_RADIUS_MM = 1.5, 2.0, 14.0

WINDOW_EFFECTS = (
    Effect(
        "housing_glass", "window",
        (Quantity("thickness_mm", "mm", 2.0, 0.0, 10.0, "thickness of a coaxial glass tube of index 1.5"),),
        0, -0.29, FixedTo.CAMERA, Channel.RING, "static",
        "δr = −t (1 − tan i′/tan i), tan i = l/r, sin i′ = sin i / n", -0.74,
        ("baseline",), "known diameters",
    ),
    Effect(
        "tube_wedge", "window",
        (Quantity("wedge_mm", "mm", 0.05, 0.0, 2.0, "amplitude of the tube's thickness"), DIRECTION),
        1, -0.27, FixedTo.CAMERA, Channel.RING, "static",
        "δr = −δt (1 − tan i′/tan i) cos(ψ − ψ₀)", 0.018,
        ("beam_decentre",), "pose known from texture",
    ),
    Effect(
        "tube_tilt", "window",
        (Quantity("tilt_deg", "deg", 1.0, 0.0, 10.0, "tilt of a coaxial glass tube 2 mm thick"), DIRECTION),
        1, 0.26, FixedTo.CAMERA, Channel.RING, "static",
        "δr = (d′(i)/sin i − (r/l) t (1 − 1/n)) χ cos(ψ − ψ₀), sin i = cos θ; exponent and size: first part",
        0.035,
        ("dome_lateral",), "pose known from texture, several diameters",
    ),
    Effect(
        "dome_axial", "window",
        (Quantity("offset_mm", "mm", 0.5, -5.0, 5.0, "axial offset of a glass dome, 2 mm, radius 14 mm"),),
        0, 1.72, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (n−1) t d sin θ / (n ρ²)", 0.217,
        ("focal_scale", "laser_cone", "pupil_shift"), "several diameters",
    ),
    Effect(
        "dome_lateral", "window",
        (Quantity("offset_mm", "mm", 0.3, 0.0, 5.0, "lateral offset of that dome"), DIRECTION),
        1, 0.72, FixedTo.CAMERA, Channel.RING, "static",
        "δr = S (n−1) t d cos θ / (n ρ²) cos(ψ − ψ₀)", 0.057,
        ("beam_decentre", "principal_point"), "several diameters, texture",
    ),
    Effect(
        "outside_index", "window",
        (Quantity("index_excess", "", 2.7e-4, -0.01, 0.4, "index of the medium less one; sealed probe"),),
        0, 1.22, FixedTo.PIPE, Channel.RING, "static",
        "δr = −(r − r_t) δn / sin²θ; water needs Snell's law in full", 0.012,
        ("baseline", "vignetting"), "a log of pressure and temperature",
    ),
)  # fmt: skip
