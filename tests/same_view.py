"""How similar a recorded frame and the model look in the review's page at the same place, lens and light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.review_browser import Tab

# Both pictures as the page draws them, without marks: grey levels, −1 where one of them shows no wall.
_BOTH = """(async ([frame, distance, azimuth, width, height, isEven]) => {
  const { model: m, session } = boresight, { source } = session, at = [distance, azimuth];
  session.moveTo(at);
  const rest = () => new Promise((r) => setTimeout(r, 50));
  const until = async (f) => { for (let k = 0; k < 400 && !f(); k++) await rest(); };
  await until(() => m.isReady);
  const stand = await source.stand(frame, at);
  session.standAs(stand);
  await until(() => m.isReady);
  const { renderer, scene, eye, marks, spot } = m, gl = renderer.getContext();
  const before = renderer.getPixelRatio(), size = m.size;
  renderer.setPixelRatio(1); renderer.setSize(width, height, false); eye.shape(width / height);
  marks.group.visible = spot.group.visible = false;
  m.fine.thin(false);
  if (isEven) m.fine.dress("even");
  scene.background = scene.background.clone().set(0x00ff00);
  renderer.render(scene, eye.camera);
  const px = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, px);
  marks.group.visible = spot.group.visible = true;
  const image = new Image();
  image.src = source.seenFrom(frame, at, eye.camera.fov, width, height);
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const seen = context.getImageData(0, 0, width, height).data;
  renderer.setPixelRatio(before); renderer.setSize(...size, false); eye.shape(size[0] / size[1]);
  session.standAs(null);
  const grey = (p, k) => (p[k] + p[k + 1] + p[k + 2]) / 3;
  const out = [[], []];
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) {
    const a = 4 * ((height - 1 - y) * width + x), b = 4 * (y * width + x);
    const isGround = px[a] === 0 && px[a + 1] === 255 && px[a + 2] === 0;
    out[0].push(isGround ? -1 : grey(px, a));
    out[1].push(seen[b + 3] < 255 ? -1 : grey(seen, b));
  }
  return out; })"""


@dataclass(frozen=True)
class ViewPair:
    """Model and frame side by side.

    Attributes
    ----------
    model, frame : (H, W)
        Grey levels; NaN where there is no wall.
    """

    model: np.ndarray
    frame: np.ndarray

    @property
    def compared(self) -> float:
        """Return the share of the picture in which both show the wall."""
        return float(np.isfinite(self.model + self.frame).mean())

    @property
    def psnr_db(self) -> float:
        """Return the peak signal (255) over the root mean square difference, dB."""
        return float(20 * np.log10(255 / np.sqrt(np.nanmean((self.model - self.frame) ** 2))))

    @property
    def brighter(self) -> float:
        """Return how many times as bright the model is as the frame, in grey levels."""
        both = np.isfinite(self.model + self.frame)
        return float(self.model[both].mean() / self.frame[both].mean())


def side_by_side(
    page: Tab, frame: int, distance: float, azimuth: float, *, is_evenly_lit: bool = False
) -> ViewPair:
    """Return the page's pictures of the model and of a frame, with the view turned to a place of the wall."""
    width, height = 640, 400
    found = np.array(
        page.js(f"{_BOTH}({[frame, distance, azimuth, width, height, int(is_evenly_lit)]})"), float
    )
    model, recorded = np.where(found < 0, np.nan, found).reshape(2, height, width)
    return ViewPair(model, recorded)
