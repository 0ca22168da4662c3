"""Texture: lit frames, motion and wall to the wall's photo as a flat picture."""

from pipeline.machine.stage import Stage
from stages.texture.texture import TextureParameters, photograph_wall

TEXTURE = Stage(
    "texture",
    "3",
    TextureParameters,
    photograph_wall,
    "lit frames to the wall's reflectance as a flat picture, light divided out",
)
