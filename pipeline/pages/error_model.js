// The exact misalignment model of pipeline/instrument/misalignment.py, for the page. Azimuths in C, mm, rad.
"use strict";
const boresight = (() => {
  const AZIMUTHS = 720;
  const rad = (deg) => (deg * Math.PI) / 180;
  const deg = (x) => (x * 180) / Math.PI;

  // The paper's eq. (1) at an azimuth from the tilt direction; positive where the radius is read too small.
  function paperError(radius, baseline, tilt, azimuth = 0) {
    const product = (radius / baseline) * Math.tan(tilt) * Math.cos(azimuth);
    return (radius * product) / (1 + product);
  }

  // One point of the ring: as it is, as triangulated with the plane z = baseline, and both errors.
  function readPoint(p, tilt, psi) {
    const c = Math.cos(psi), s = Math.sin(psi), R = p.diameter_mm / 2;
    const ex = p.offset_x_mm, ey = p.offset_y_mm, along = c * ex + s * ey;
    const reach = -along + Math.sqrt(R * R - ex * ex - ey * ey + along * along);
    const cone = Math.tan(rad(180 - p.opening_angle_deg) / 2);
    const slope = Math.tan(tilt) * Math.cos(psi - rad(p.tilt_direction_deg)) + cone;
    const z = p.baseline_mm + reach * slope;
    const k = p.baseline_mm / z;
    const radial = Math.hypot(c * reach * k + ex, s * reach * k + ey) - R;
    return {
      psi, x: c * reach, y: s * reach, z, ax: c * reach * k, ay: s * reach * k, az: p.baseline_mm,
      radial, euclidean: Math.hypot(reach, z) * Math.abs(k - 1),
    };
  }

  function readRing(p, tilt = rad(p.tilt_deg)) {
    const start = rad(p.tilt_direction_deg);
    return Array.from({ length: AZIMUTHS }, (_, i) => readPoint(p, tilt, start + (2 * Math.PI * i) / AZIMUTHS));
  }

  function largestError(p, tilt) {
    let worst = 0;
    for (const q of readRing(p, tilt)) {
      if (!(q.z > 0)) return Infinity;
      worst = Math.max(worst, Math.abs(q.radial));
    }
    return worst;
  }

  // Gauss-Newton for the circle with least squared distances.
  function fitCircle(points) {
    const n = points.length;
    let cx = points.reduce((a, q) => a + q.ax, 0) / n, cy = points.reduce((a, q) => a + q.ay, 0) / n;
    for (let i = 0; i < 20; i++) {
      const A = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]];
      for (const q of points) {
        const d = Math.hypot(q.ax - cx, q.ay - cy), row = [(q.ax - cx) / d, (q.ay - cy) / d, 1];
        for (let a = 0; a < 3; a++) {
          for (let b = 0; b < 3; b++) A[a][b] += row[a] * row[b];
          A[a][3] += row[a] * d;
        }
      }
      const step = solve3(A);
      cx += step[0];
      cy += step[1];
      if (Math.max(Math.abs(step[0]), Math.abs(step[1])) < 1e-12) break;
    }
    return { cx, cy, r: points.reduce((a, q) => a + Math.hypot(q.ax - cx, q.ay - cy), 0) / n };
  }

  function solve3(A) {
    for (let i = 0; i < 3; i++) {
      let best = i;
      for (let j = i + 1; j < 3; j++) if (Math.abs(A[j][i]) > Math.abs(A[best][i])) best = j;
      [A[i], A[best]] = [A[best], A[i]];
      for (let j = 0; j < 3; j++) {
        if (j === i) continue;
        const f = A[j][i] / A[i][i];
        for (let k = i; k < 4; k++) A[j][k] -= f * A[i][k];
      }
    }
    return A.map((row, i) => row[3] / row[i]);
  }

  // Largest tilt that keeps every point within the accuracy, or null where the error is larger without any.
  function allowedTilt(p, accuracy) {
    if (largestError(p, 0) > accuracy) return null;
    let low = 0, high = Math.PI / 2;
    for (let i = 0; i < 60; i++) {
      const middle = (low + high) / 2;
      if (largestError(p, middle) <= accuracy) low = middle;
      else high = middle;
    }
    return deg(low);
  }

  // Baselines at which the paper's radial and its Euclidean error reach the accuracy.
  function impliedBaselines(diameter, tiltDeg, accuracy) {
    const r = diameter / 2, lift = r * Math.tan(rad(tiltDeg));
    const euclidean = accuracy > lift ? r / Math.sqrt((accuracy / lift) ** 2 - 1) - lift : null;
    return { radial_mm: (lift * (r - accuracy)) / accuracy, euclidean_mm: euclidean };
  }

  // Kannala-Brandt (OpenCV fisheye), or a table of (radial, tangential) px over polar angle and azimuth.
  function project(camera, x, y, z) {
    const theta = Math.atan2(Math.hypot(x, y), z), psi = Math.atan2(y, x);
    if (camera.model === "kannala_brandt") {
      const [k1, k2, k3, k4] = camera.distortion, t2 = theta * theta;
      if (!rising(camera.distortion, theta)) return null;
      const rho = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
      return [
        camera.focal_px[0] * rho * Math.cos(psi) + camera.centre_px[0],
        camera.focal_px[1] * rho * Math.sin(psi) + camera.centre_px[1],
      ];
    }
    return fromTable(camera, theta, psi);
  }

  function rising([k1, k2, k3, k4], theta) {
    for (let i = 1; i <= 64; i++) {
      const t2 = ((theta * i) / 64) ** 2;
      if (1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4))) <= 0) return false;
    }
    return true;
  }

  function fromTable(camera, theta, psi) {
    const T = camera.table, rows = T.length, columns = T[0].length;
    const t = theta / camera.theta_step_rad, a = ((psi / (2 * Math.PI) + 1) % 1) * columns;
    const i = Math.min(Math.floor(t), rows - 2), j = Math.floor(a) % columns, u = t - i, v = a - Math.floor(a);
    if (t > rows - 1) return null;
    const mix = (k) => {
      const [p00, p01, p10, p11] = [T[i][j], T[i][(j + 1) % columns], T[i + 1][j], T[i + 1][(j + 1) % columns]];
      if (!p00 || !p01 || !p10 || !p11) return NaN;
      return (p00[k] * (1 - v) + p01[k] * v) * (1 - u) + (p10[k] * (1 - v) + p11[k] * v) * u;
    };
    const radial = mix(0), tangential = mix(1), c = Math.cos(psi), s = Math.sin(psi);
    if (!Number.isFinite(radial)) return null;
    return [camera.centre_px[0] + radial * c - tangential * s, camera.centre_px[1] + radial * s + tangential * c];
  }

  // Where the ring, and the ring of an untilted plane at the same azimuths, lie in the image.
  function ringImage(p, ring) {
    const plane = readRing({ ...p, opening_angle_deg: 180 }, 0);
    const inside = ([u, v]) => u >= -0.5 && v >= -0.5 && u < p.camera.image_size[0] - 0.5 && v < p.camera.image_size[1] - 0.5;
    let seen = 0, shift = 0;
    const uv = ring.map((q, i) => {
      const real = project(p.camera, q.x, q.y, q.z), expected = project(p.camera, plane[i].x, plane[i].y, plane[i].z);
      const visible = Boolean(real && inside(real));
      if (visible) seen += 1;
      if (real && expected) shift = Math.max(shift, Math.hypot(real[0] - expected[0], real[1] - expected[1]));
      return { real, expected, visible };
    });
    return { uv, visible_share: seen / ring.length, max_image_shift_px: shift };
  }

  function problemOf(p) {
    const positive = [["diameter_mm", p.diameter_mm], ["baseline_mm", p.baseline_mm], ["accuracy_mm", p.accuracy_mm]];
    for (const [name, value] of positive) if (!(value > 0 && value < Infinity)) return `${name} must be above 0`;
    if (!(p.tilt_deg >= 0 && p.tilt_deg < 90)) return "The tilt must be from 0 to below 90°.";
    if (!(p.opening_angle_deg > 90 && p.opening_angle_deg < 270)) return "The opening angle must be between 90° and 270°.";
    if (!(Math.hypot(p.offset_x_mm, p.offset_y_mm) < p.diameter_mm / 2)) return "The probe is outside the pipe.";
    if (largestError(p, rad(p.tilt_deg)) === Infinity) {
      return "On one side the sheet meets the wall beside or behind the camera: reduce the tilt or raise the baseline.";
    }
    return null;
  }

  // All figures of a scan. Takes the names of the command line; `camera` is optional.
  function compute(params) {
    const p = {
      diameter_mm: 101.6, baseline_mm: 22, tilt_deg: 0, tilt_direction_deg: 0, opening_angle_deg: 180,
      offset_x_mm: 0, offset_y_mm: 0, accuracy_mm: 0.1, camera: null, ...params,
    };
    const problem = problemOf(p);
    if (problem) return { problem };
    const whole = readRing(p), r = p.diameter_mm / 2;
    const image = p.camera ? ringImage(p, whole) : null;
    if (image && image.visible_share < 0.25) {
      return { problem: `The camera sees ${(100 * image.visible_share).toFixed(0)} % of the ring: take a longer baseline or a wider camera.` };
    }
    const ring = image ? whole.filter((_, i) => image.uv[i].visible) : whole, circle = fitCircle(ring);
    if (image) image.uv = image.uv.filter((q) => q.visible);
    return {
      problem: null,
      paper_equation_mm: paperError(r, p.baseline_mm, rad(p.tilt_deg)),
      max_radial_mm: Math.max(...ring.map((q) => Math.abs(q.radial))),
      max_euclidean_mm: Math.max(...ring.map((q) => q.euclidean)),
      ring_centre_shift_mm: Math.hypot(circle.cx + p.offset_x_mm, circle.cy + p.offset_y_mm),
      ring_radius_change_mm: circle.r - r,
      allowed_tilt_deg: allowedTilt(p, p.accuracy_mm),
      implied_baseline: impliedBaselines(p.diameter_mm, p.tilt_deg, p.accuracy_mm),
      visible_share: image ? image.visible_share : null,
      max_image_shift_px: image ? image.max_image_shift_px : null,
      ring, circle, image,
    };
  }

  // Largest radial error over tilt, for the chart; null where the sheet no longer reaches the wall.
  function errorOverTilt(p, tilts) {
    return tilts.map((t) => {
      const worst = largestError(p, rad(t));
      return worst === Infinity ? null : worst;
    });
  }

  // The camera and laser of a probe.yaml or camera file; only what this page uses, kannala_brandt only.
  function parseProbe(text) {
    const list = (name) => {
      const m = text.match(new RegExp(`^[ ]*${name}:[ ]*(?:\\[([^\\]]*)\\]|((?:\\r?\\n[ ]*-[^\\n]*)+))`, "m"));
      if (!m) throw new Error(`${name} is missing`);
      const values = m[1] !== undefined ? m[1].split(",") : m[2].trim().split(/\n/).map((x) => x.replace(/^\s*-/, ""));
      return values.map(Number);
    };
    const scalar = (name) => {
      const m = text.match(new RegExp(`^[ ]*${name}:[ ]*(-?[0-9.eE+-]+)[ ]*(?:#.*)?$`, "m"));
      return m ? Number(m[1]) : null;
    };
    const model = (text.match(/^[ ]*model:[ ]*["']?([A-Za-z_]+)/m) || [])[1];
    if (model !== "kannala_brandt") throw new Error(`camera model ${model || "missing"}: this page reads kannala_brandt`);
    const camera = { model, image_size: list("image_size"), focal_px: list("focal_px"), centre_px: list("centre_px"), distortion: list("distortion") };
    const lengths = { image_size: 2, focal_px: 2, centre_px: 2, distortion: 4 };
    for (const [name, n] of Object.entries(lengths)) {
      if (camera[name].length !== n || !camera[name].every(Number.isFinite)) throw new Error(`${name} needs ${n} numbers`);
    }
    const laser = {};
    for (const name of ["baseline_mm", "opening_angle_deg", "tilt_deg", "tilt_direction_deg"]) laser[name] = scalar(name);
    return { camera, laser };
  }

  return { compute, paperError, readRing, errorOverTilt, parseProbe, project, rad, deg };
})();
if (typeof window !== "undefined") window.boresight = boresight;
else module.exports = boresight;
