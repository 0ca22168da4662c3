"""Which rays of a picture are traced, for any picture size."""

from types import SimpleNamespace

import numpy as np
import pytest

from stages.twin.scene import Scene
from stages.twin.state import _view


@pytest.mark.parametrize("width", [40, 41, 42, 43])
@pytest.mark.parametrize("height", [36, 37, 39])
def test_in_pictures_of_any_size_the_rays_that_see_wall_are_traced(width, height):
    """A picture whose side is one more than a multiple of four ended the twin with an error."""

    def unproject(uv):
        ray = np.concatenate([uv / 50, np.ones((*uv.shape[:2], 1))], -1)
        return SimpleNamespace(ray=ray, valid=np.ones(uv.shape[:2], bool))

    camera = SimpleNamespace(image_size=(width, height), unproject=unproject)
    outside = np.zeros((height, width), bool)
    outside[:, 30:] = True
    rays = Scene(SimpleNamespace(camera=camera), None, None, None, outside)._rays
    assert rays.shape == (-(-height // 4), -(-width // 4), 3)
    assert np.isfinite(rays[:, :7]).all()
    assert np.isnan(rays[:, -1]).all()


def test_the_rim_of_the_picture_is_an_edge_of_the_view():
    """A last row that the camera left dark was "scatter of 17 % of the light" in two recordings."""
    lit = np.full((60, 80), 90.0, np.float32)
    lit[-1] = 16.0
    outside, edge = _view([lit, lit], 16.0, SimpleNamespace(polar=(None, None, np.ones((60, 80), bool))))
    assert (outside | edge)[[0, 1, -2, -1]].all()
    assert (outside | edge)[:, [0, 1, -2, -1]].all()
    assert not (outside | edge)[12:-12, 12:-12].any()
