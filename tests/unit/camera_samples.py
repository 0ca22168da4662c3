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


KALIBR = """
cam0:
  cam_overlaps: []
  camera_model: omni
  distortion_coeffs: [-0.3, 0.1, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [1.4, 900.0, 901.0, 640.5, 400.5]
  resolution: [1280, 800]
  rostopic: /camera
"""

OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 300., 0., 320., 0., 301., 240., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ 1.e-01, 2.0e-02, 0., 0. ]
fisheye_model: 1
"""

OCAMCALIB = """#direct
5 -520.5652 0.0 8.352995e-04 -7.676461e-07 8.237295e-10

#inverse
12 825.895938 495.981451 -42.499088 56.094452 59.572411 -34.740913 16.605677 73.767555 -6.589434 -64.870872 \
-37.527006 -6.759911

#center
553.766179 962.534189
#affine
1.000305 -0.000492 -0.001864
#size
1080 1920
"""

CAMODOCAL = """%YAML:1.0
model_type: KANNALA_BRANDT
camera_name: camera
image_width: 1296
image_height: 972
projection_parameters:
   k2: 9.8467e-02
   k3: -3.27869e-02
   k4: -8.5313419e-04
   k5: 3.5386e-04
   mu: 2.7299e+02
   mv: 2.7297e+02
   u0: 5.7735e+02
   v0: 5.0894e+02
"""

GOOD = {"opencv": OPENCV, "kalibr": KALIBR, "ocamcalib": OCAMCALIB, "camodocal": CAMODOCAL}
