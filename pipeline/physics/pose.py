"""Effects of the pose, the pipe and the odometer."""

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity
from pipeline.physics.laser import DIRECTION

POSE_EFFECTS = (
    Effect(
        "pipe_bend", "pose",
        (Quantity("curvature_per_mm", "1/mm", 0.0004, 0.0, 0.02, "curvature of the axis"), DIRECTION),
        1, None, FixedTo.PIPE, Channel.MOTION, "static",
        "sagitta L²/8ρ; arc ds (1 − (r/ρ) cos(ψ − ψ₀))", None,
        (), "curvature along the distance, texture",
    ),
    Effect(
        "ovality", "pose",
        (Quantity("amplitude_mm", "mm", 0.15, 0.0, 5.0, "amplitude a₂ of the radius"), DIRECTION),
        2, 0.0, FixedTo.PIPE, Channel.RING, "static",
        "a₂ cos 2(ψ − ψ₀)", 0.15,
        ("pixel_aspect", "sheet_waviness"), "roll",
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
        ("laser_rocking",), "texture that moves along, several diameters",
    ),
    Effect(
        "encoder_scale", "pose",
        (Quantity("relative", "", 0.005, -0.1, 0.1, "reading over true distance, less one"),),
        None, None, FixedTo.PIPE, Channel.MOTION, "static",
        "reading = s (1 + κ); visual/encoder = (1 − δl/l)/(1 + κ)", None,
        ("baseline",), "a known diameter",
    ),
    Effect(
        "encoder_slip", "pose",
        (
            Quantity("slip_mm", "mm", 3.0, -100.0, 100.0, "distance the reading gains at the slip"),
            Quantity("time_s", "s", 4.0, 0.0, 1e6, "when it slips"),
        ),
        None, None, FixedTo.TIME, Channel.MOTION, "event",
        "a step in visual − encoder", None,
        (), "dropped frames show in both passes and in the times",
    ),
    Effect(
        "encoder_backlash", "pose",
        (Quantity("backlash_mm", "mm", 0.5, 0.0, 10.0, "lost motion b at a reversal"),),
        None, None, FixedTo.TIME, Channel.MOTION, "reversal",
        "reading = s − (b/2) sgn v", None,
        ("time_offset",), "changes of |v| without reversal",
    ),
    Effect(
        "time_offset", "pose",
        (Quantity("delay_s", "s", 0.02, -1.0, 1.0, "by which the encoder's readings are late"),),
        None, None, FixedTo.TIME, Channel.MOTION, "speed",
        "visual − encoder = v τ", None,
        ("encoder_backlash",), "changes of |v|",
    ),
)  # fmt: skip
