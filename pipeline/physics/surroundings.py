"""Known effects of pipe, motion and odometer, and of the line's light."""

from __future__ import annotations

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity
from pipeline.physics.instrument import DIRECTION

POSE_EFFECTS = (
    Effect(
        "pipe_bend", "pose",
        (Quantity("curvature_per_mm", "1/mm", 0.0004, 0.0, 0.02, "curvature of the axis"), DIRECTION),
        1, None, FixedTo.PIPE, Channel.MOTION, "static",
        "sagitta L²/8ρ; arc ds (1 − (r/ρ) cos(ψ − ψ₀))", None,
        (), "a longer run (the curvature changes with the distance), a wall with texture",
    ),
    Effect(
        "ovality", "pose",
        (Quantity("amplitude_mm", "mm", 0.15, 0.0, 5.0, "amplitude a₂ of the radius"), DIRECTION),
        2, 0.0, FixedTo.PIPE, Channel.RING, "static",
        "a₂ cos 2(ψ − ψ₀)", 0.15,
        ("pixel_aspect", "sheet_waviness"), "a run with roll",
    ),
    Effect(
        "probe_vibration", "pose",
        (
            Quantity("amplitude_mm", "mm", 0.2, 0.0, 5.0, "amplitude of the camera's way across the axis"),
            Quantity("frequency_hz", "Hz", 5.3, 0.05, 200.0, "frequency of the vibration"),
            DIRECTION,
        ),
        1, 0.0, FixedTo.TIME, Channel.MOTION, "periodic",
        "e(t) = a sin(2πft), seen at |f − k·frame rate|; the pose absorbs nearly all of it", 0.2,
        ("laser_rocking",),
        "a wall with texture (a vibrating probe moves it, a rocking sheet not), bores of several diameters",
    ),
    Effect(
        "encoder_scale", "pose",
        (Quantity("relative", "", 0.005, -0.1, 0.1, "reading over true distance, less one"),),
        None, None, FixedTo.PIPE, Channel.MOTION, "static",
        "reading = s (1 + κ); (way by pictures) / (way by encoder) = (1 − δl/l)/(1 + κ)", None,
        ("baseline",), "a bore of known diameter",
    ),
    Effect(
        "encoder_slip", "pose",
        (
            Quantity("slip_mm", "mm", 3.0, -100.0, 100.0, "distance the reading gains at the slip"),
            Quantity("time_s", "s", 4.0, 0.0, 1e6, "when it slips"),
        ),
        None, None, FixedTo.TIME, Channel.MOTION, "event",
        "a step in (way by pictures) − (way by encoder)", None,
        (), "a second pass of the same wall (a slip does not repeat)",
    ),
    Effect(
        "encoder_backlash", "pose",
        (Quantity("backlash_mm", "mm", 0.5, 0.0, 10.0, "lost motion b at a reversal"),),
        None, None, FixedTo.TIME, Channel.MOTION, "reversal",
        "reading = s − (b/2) sgn v", None,
        ("time_offset",), "a run with changes of speed without a reversal",
    ),
    Effect(
        "time_offset", "pose",
        (Quantity("delay_s", "s", 0.02, -1.0, 1.0, "by which the encoder's readings are late"),),
        None, None, FixedTo.TIME, Channel.MOTION, "speed",
        "(way by pictures) − (way by encoder) = v τ", None,
        ("encoder_backlash",), "a run with changes of speed",
    ),
)  # fmt: skip


PHOTOMETRIC_EFFECTS = (
    Effect(
        "albedo_bias", "photometric",
        (Quantity("line_sigma_mm", "mm", 0.3, 0.0, 2.0, "1 σ of the line's width on the wall, true"),),
        None, None, FixedTo.PIPE, Channel.RING, "static",
        "δr = −(r/l) σ_z² ∂_z ln A", 0.042,
        ("slope_bias",), "a wall whose brightness changes strongly; a laser line of another width",
    ),
    Effect(
        "slope_bias", "photometric",
        (Quantity("gloss", "", 0.5, 0.0, 1.0, "share of the reflectance that is a glossy lobe"),),
        None, None, FixedTo.PIPE, Channel.PROFILE, "static",
        "δr = −(r/l) σ_z² ∂_z ln BRDF; a glint where the axial slope is i/2", 0.1,
        ("albedo_bias",), "a weld bead seen from its other side (skewness and saturation of the line there)",
    ),
    Effect(
        "subsurface", "photometric",
        (Quantity("transport_mm", "mm", 0.3, 0.0, 3.0, "mean way of light within the wall"),),
        0, None, FixedTo.PIPE, Channel.PROFILE, "static",
        "one-sided exponential tail; bias about the transport length", 0.3,
        ("line_skew",), "the line on a wall that no light enters (bare metal), a laser of another wavelength",
    ),
    Effect(
        "ghost_ring", "photometric",
        (Quantity("relative", "", 0.1, 0.0, 1.0, "height of the ghost over that of the line"),),
        None, None, FixedTo.LASER, Channel.PROFILE, "static",
        "bounced over the bore, apart by tilt −4 r φ cos(ψ − ψ₀), cone 2 r ε₀, m even 2 r ε_m, odd −4 r ε_m",
        None, ("tube_ghost", "line_skew"),
        "bores of several diameters (a bounced line moves away in a wide one, a copy by glass stays)",
    ),
    Effect(
        "tube_ghost", "photometric",
        (
            Quantity("relative", "", 0.002, 0.0, 0.5, "height of the copy over that of the line"),
            Quantity("separation_mm", "mm", 1.1, -5.0, 5.0, "axial distance 2 t tan i′ of the copy"),
        ),
        0, None, FixedTo.LASER, Channel.PROFILE, "static",
        "a faint copy of the line at constant spacing", None,
        ("ghost_ring",),
        "bores of several diameters (a bounced line moves away in a wide one, a copy by glass stays)",
    ),
    Effect(
        "line_skew", "photometric",
        (Quantity("skewness", "", 0.3, -2.0, 2.0, "skewness of the sheet's own profile"),),
        0, 1.0, FixedTo.LASER, Channel.PROFILE, "static",
        "δr of the peak of the order of (r/l) σ × skewness, at most half of it", None,
        ("subsurface",), "a laser line of another width",
    ),
    Effect(
        "speckle", "photometric",
        (Quantity("contrast", "", 0.3, 0.0, 1.0, "speckle contrast C"),),
        None, None, FixedTo.PIPE, Channel.RING, "static",
        "σ_r = (S/√(l² + r²)) C λ/(2π sin u)", 0.03,
        (), "it is the noise floor: near-white in a frame, fixed to the wall",
    ),
    Effect(
        "saturation", "photometric",
        (Quantity("exposure_gain", "", 1.6, 1.0, 20.0, "line's peak over full scale"),),
        0, None, FixedTo.CAMERA, Channel.PROFILE, "static",
        "clipping an asymmetric profile shifts it; bloom along columns", None,
        ("gamma",), "a run with a step of exposure",
    ),
    Effect(
        "gamma", "photometric",
        (Quantity("exponent", "", 0.8, 0.2, 3.0, "grey = light to this power; 1 is linear"),),
        0, None, FixedTo.CAMERA, Channel.PROFILE, "static",
        "I^γ on a skewed profile; width ∝ 1/√γ", None,
        ("saturation",), "a run with a step of exposure",
    ),
    Effect(
        "vignetting", "photometric",
        (Quantity("falloff", "", 0.5, 0.0, 5.0, "light falls as cos^k θ beyond the stated, exponent k"),),
        0, None, FixedTo.CAMERA, Channel.PROFILE, "static",
        "δr = (S/f) σ_px² ∂ ln V/∂ρ, σ of the line before the lens blurs it", 0.008,
        ("baseline",), "a laser line of another width",
    ),
    Effect(
        "ambient_light", "photometric",
        (Quantity("relative", "", 0.1, 0.0, 1.0, "stray light over the line's height, most at openings"),),
        None, None, FixedTo.PIPE, Channel.PROFILE, "static",
        "δρ = (2/3) b′W³ / (Aσ√2π + 2bW)", None,
        (), "frames with the laser off",
    ),
    Effect(
        "fixed_pattern", "photometric",
        (Quantity("relative", "", 0.02, 0.0, 0.5, "1 σ of the pixels' gain"),),
        None, None, FixedTo.CAMERA, Channel.RING, "static",
        "fixed in (x, y), hit when the ring passes", None,
        ("dust",), "a longer run (the pattern stays at its pixels)",
    ),
    Effect(
        "dust", "photometric",
        (
            Quantity("attenuation", "", 0.5, 0.0, 1.0, "light lost in the spot's middle"),
            Quantity("azimuth_deg", "deg", 60.0, -360.0, 360.0, "where around the ring"),
            Quantity("width_deg", "deg", 4.0, 0.2, 60.0, "1 σ of the spot around the ring"),
        ),
        None, None, FixedTo.CAMERA, Channel.PROFILE, "static",
        "light attenuated at a place fixed in C, or in passing", None,
        ("fixed_pattern",), "a run after the window was cleaned",
    ),
)  # fmt: skip
