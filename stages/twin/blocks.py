"""Blocks of frames that the run has measured, beside those of their twins."""

from __future__ import annotations

from dataclasses import replace

from pipeline.arrays import Float32
from stages.twin.compare import block_ratios, block_textures
from stages.twin.render import Renderer
from stages.twin.scene import Scene
from stages.twin.state import PhotometricState, Sampled


def blocks_of(
    scene: Scene, state: PhotometricState, sampled: list[Sampled]
) -> tuple[list[Float32], list[tuple[Float32, Float32]]]:
    """Return, for blocks of the sampled lit frames, recorded over predicted brightness, and texture."""
    noise, renderer = state.noise, Renderer(replace(scene, outside=state.outside), state)
    lit = [s for s in sampled if s.light in state.shows_wall]
    twins = [renderer.frame(s.frame, s.light).drawn_aside(state.aside) for s in lit]
    made = [(noise.above_black(s.image), t, noise.full_scale) for s, t in zip(lit, twins, strict=True)]
    return [block_ratios(*m) for m in made], [block_textures(*m) for m in made]
