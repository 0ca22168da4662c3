"""Known effects on pictures that leave the geometry alone: light, window, lens, sensor.

The twin names them from pictures. The diagnosis of rings does not know them: they are no part of `EFFECTS`.
"""

from __future__ import annotations

from pipeline.physics.effect import Channel, Effect, FixedTo, Quantity


def _effect(
    name: str, quantities: tuple[Quantity, ...], fixed_to: FixedTo, time: str, law: str, told_apart_by: str,
    alike: tuple[str, ...] = (),
) -> Effect:  # fmt: skip
    """Return an effect of this family, which has no radius error of its own."""
    return Effect(
        name, "picture", quantities, None, None, fixed_to, Channel.PICTURE, time, law, None, alike,
        told_apart_by,
    )  # fmt: skip


_AZIMUTH = Quantity("azimuth_deg", "deg", 60.0, -360.0, 360.0, "where around the optical axis")
_WIDTH = Quantity("width_deg", "deg", 4.0, 0.2, 60.0, "1 σ of the spot around the ring")

PICTURE_EFFECTS = (
    _effect(
        "light_flicker",
        (
            Quantity("relative", "", 0.05, 0.0, 1.0, "amplitude of the lights' power over its mean"),
            Quantity("frequency_hz", "Hz", 100.0, 0.01, 1e5, "frequency"),
        ),
        FixedTo.TIME, "periodic",
        "1 + a sinc(f t_e) sin 2πft for a row exposed t_e long about t: frames, or rows one by one, differ",
        "all of a row or frame changes by one factor, laser and LEDs alike",
    ),
    _effect(
        "led_dead",
        (Quantity("lost", "", 1.0, 0.0, 1.0, "share of the LED's light that is missing"), _AZIMUTH),
        FixedTo.CAMERA, "static",
        "the LED next to an azimuth sends less",
        "the wall darkens on one side of LED frames; laser frames do not",
    ),
    _effect(
        "laser_sector",
        (
            Quantity("lost", "", 0.8, 0.0, 1.0, "share of the sheet's light that is missing in the middle"),
            _AZIMUTH,
            Quantity("width_deg", "deg", 20.0, 0.5, 180.0, "width of the sector at half of the loss"),
        ),
        FixedTo.LASER, "static",
        "power × (1 − lost · exp(−ln 2 · (2 Δψ/width)⁸))", "LED frames do not show it", ("dust",),
    ),
    _effect(
        "bloom",
        (
            Quantity("relative", "", 0.3, 0.0, 1.0, "share of the light above full scale that leaks"),
            Quantity("length_px", "px", 6.0, 0.5, 200.0, "way along the column after which 1/e is left"),
        ),
        FixedTo.CAMERA, "static",
        "charge above the full well spreads along columns as exp(−|Δv|/length); its sum is kept",
        "columns only, and only beside clipped pixels", ("saturation",),
    ),
    _effect(
        "black_level",
        (Quantity("grey", "", 8.0, 0.0, 100.0, "grey levels, of 255, without light"),),
        FixedTo.CAMERA, "static", "grey = black + (255 − black) · light", "pixels that see no wall",
        ("ambient_light",),
    ),
    _effect(
        "defocus",
        (
            Quantity("middle_px", "px", 0.5, 0.0, 10.0, "1 σ of blur added in the picture's middle"),
            Quantity("edge_px", "px", 2.0, 0.0, 10.0, "1 σ of blur added half its smaller side away"),
        ),
        FixedTo.CAMERA, "static",
        "variance of the blur grows by middle² + edge² (ρ/ρ_e)⁴: σ of a tilted or curved field grows with ρ²",
        "texture and line blur alike, most at the edge", ("motion_blur",),
    ),
    _effect(
        "window_scatter",
        (
            Quantity("share", "", 0.5, 0.0, 1.0, "share of the light that is scattered in the spot's middle"),
            _AZIMUTH, _WIDTH,
        ),
        FixedTo.CAMERA, "static",
        "light L becomes (1 − a w) L + a w ⟨L⟩, ⟨L⟩ its mean widely around, w the spot",
        "contrast falls though brightness need not", ("dust",),
    ),
    _effect(
        "droplet",
        (
            Quantity("power", "", 1.0, 0.0, 2.0, "bending: 1 spreads one point over the middle, 2 inverts"),
            _AZIMUTH, _WIDTH,
        ),
        FixedTo.CAMERA, "static",
        "within the radius R a pixel at Δ sees what is at Δ (1 − power (1 − Δ²/R²)); the edge stays",
        "texture is displaced at a place fixed in the picture", ("dust", "window_scatter"),
    ),
    _effect(
        "defective_pixels",
        (
            Quantity("share", "", 1e-4, 0.0, 0.1, "share of pixels that are hot; as many are dead"),
            Quantity("level", "", 0.5, 0.0, 1.0, "dark signal of a hot pixel, full scales"),
        ),
        FixedTo.CAMERA, "static", "a hot pixel adds its dark signal; a dead one gives nothing",
        "single pixels, at the same place in all frames",
    ),
    _effect(
        "read_noise",
        (Quantity("electrons", "e", 30.0, 0.0, 1000.0, "1 σ added to the read noise (EMVA 1288: σ_d)"),),
        FixedTo.CAMERA, "static", "σ² = σ_d² + μ_e", "dark pixels: the noise that is left without light",
    ),
    _effect(
        "full_well",
        (Quantity("electrons", "e", 4000.0, 100.0, 1e6, "electrons at full scale (EMVA 1288: saturation)"),),
        FixedTo.CAMERA, "static", "variance over mean, the gain, is full scale over electrons",
        "photon transfer: variance against mean",
    ),
    _effect(
        "dark_pattern",
        (Quantity("relative", "", 0.005, 0.0, 0.2, "1 σ of the pixels' dark signal, full scales (DSNU)"),),
        FixedTo.CAMERA, "static", "each pixel adds an offset of its own", "mean of dark frames",
        ("fixed_pattern",),
    ),
    _effect(
        "interreflection",
        (Quantity("relative", "", 1.0, 0.0, 5.0, "light bounced once over that of a dull round bore"),),
        FixedTo.PIPE, "static",
        "E₁(s) = A ∫ K(s − s′) E₀(s′) ds′, K dx = (1 − X(2X² + 3)/(2(X² + 1)^1.5)) dX, X = |x|/2r",
        "a glow about the line that ends a bore's width away, brighter where the wall is paler",
        ("ambient_light",),
    ),
)  # fmt: skip
