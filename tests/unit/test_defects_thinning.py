"""Areas are thinned to the same lines as by OpenCV, which goes through the whole picture in every round."""

import cv2
import numpy as np

from pipeline.arrays import Bool
from stages.defects.thinning import thinned


def _shapes(number: int) -> Bool:
    """Return random areas, some of which touch the border of the picture."""
    rng = np.random.default_rng(number)
    noise = rng.standard_normal(rng.integers(3, 80, 2))
    smooth = cv2.GaussianBlur(noise, (0, 0), rng.uniform(0.3, 4))
    return np.asarray(smooth > np.quantile(smooth, rng.uniform(0.05, 0.95)))


def test_areas_are_thinned_like_opencv_does() -> None:
    for number in range(100):
        area = _shapes(number)
        before = area.copy()
        expected = cv2.ximgproc.thinning(np.where(area, 255, 0).astype(np.uint8)) > 0
        np.testing.assert_array_equal(thinned(area), expected)
        np.testing.assert_array_equal(area, before)


def test_an_empty_area_stays_empty() -> None:
    assert not thinned(np.zeros((5, 7), bool)).any()
