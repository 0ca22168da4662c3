"""One camera of each model and shape, with real calibrations' numbers, for the camera tests."""

import numpy as np

from pipeline.instrument.camera import Camera
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.plumb_bob import Pinhole, Unified
from pipeline.instrument.camera.scaramuzza import Scaramuzza

KANNALA_BRANDT = KannalaBrandt(
    (1600, 1200), (366.1, 365.2), (796.9, 591.8), (-0.011789, 0.000796, -0.000835, 0.0001)
)
SCARAMUZZA = Scaramuzza(
    (1920, 1080),
    (962.534, 553.766),
    (-520.5652, 0.0, 8.352995e-04, -7.676461e-07, 8.237295e-10),
    (1.000305, -0.000492, -0.001864),
)

CAMERAS: dict[str, Camera] = {
    "kannala_brandt": KANNALA_BRANDT,
    "kannala_brandt that turns back": KannalaBrandt(
        (1232, 1028), (256.9, 257.2), (609.3, 521.1), (0.0185, -2.8e-4, -1.36e-3, -2.0e-4)
    ),
    "equidistant": Equidistant((1600, 1200), (360.0, 361.0), (799.5, 599.5)),
    "scaramuzza": SCARAMUZZA,
    "unified, xi below 1": Unified(
        (1280, 800), 0.87, (520.0, 521.0), (640.2, 399.1), (-0.1, 0.01, 1e-3, -2e-3)
    ),
    "unified, xi above 1": Unified(
        (1232, 1028), 1.1764148, (556.43, 555.90), (609.485, 523.501), (-0.19248, 0.008368, 8.4e-5, -4.2e-4)
    ),
    "unified, xi near 2": Unified(
        (1296, 972), 1.9029288, (788.85, 789.54), (577.97, 510.98), (0.76286, -1.73774, -3.94e-3, -9.15e-4)
    ),
    "pinhole": Pinhole((1280, 960), (1450.0, 1452.0), (641.0, 478.0), (-0.21, 0.13, 1e-3, -5e-4, -0.03)),
    "pinhole without distortion": Pinhole((640, 480), (500.0, 501.0), (319.5, 239.5)),
}

BEYOND_90 = [name for name in CAMERAS if not name.startswith("pinhole")]


def widest_angle(camera: Camera) -> float:
    """Return the polar angle, rad, up to which the camera maps every azimuth."""
    theta = np.linspace(0.0, np.pi, 3001)
    psi = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    valid = camera.project(directions(theta[:, None], psi[None, :])).valid.all(1)
    return float(theta[np.flatnonzero(~valid)[0] - 1]) if not valid.all() else float(np.pi)


def directions(theta, psi):
    """Return unit vectors of polar angle and azimuth."""
    theta, psi = np.broadcast_arrays(theta, psi)
    return np.stack([np.sin(theta) * np.cos(psi), np.sin(theta) * np.sin(psi), np.cos(theta)], -1)


def sample_directions(camera: Camera, share: float = 0.97) -> np.ndarray:
    """Return (N, 3) unit vectors from the axis to ``share`` of the widest angle."""
    theta = np.concatenate([[0.0, 1e-9, 1e-4], np.linspace(0.01, share * widest_angle(camera), 40)])
    psi = np.linspace(-np.pi, np.pi, 23, endpoint=False)
    return directions(theta[:, None], psi[None, :]).reshape(-1, 3)
