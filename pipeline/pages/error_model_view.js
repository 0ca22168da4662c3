// Controls, figures and charts of the page. Everything computed comes from boresight.compute.
"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const start = JSON.parse($("start").textContent);
  let camera = start.camera, cameraName = start.camera_name;
  const view = { yaw: -0.65, pitch: 0.3 };
  const inputs = {};
  const um = (mm) => `${(1000 * mm).toFixed(1)} µm`;
  const length = (mm) => (Math.abs(mm) < 0.0995 ? um(mm) : `${mm.toFixed(3)} mm`);

  function buildSlider(box) {
    const { name, label, unit, min, max, step } = box.dataset, id = `in-${name}`;
    const low = Math.min(Number(min), start[name]), high = Math.max(Number(max), start[name]);
    box.innerHTML = `<label for="${id}">${label}</label><div class="row">
      <input type="range" id="${id}" min="${low}" max="${high}" step="any" aria-valuetext="">
      <input type="number" min="${low}" max="${high}" step="any" aria-label="${label}, typed"><span class="unit">${unit}</span></div>`;
    const [range, number] = box.querySelectorAll("input");
    const set = (value) => {
      const v = Number(value);
      range.value = v;
      number.value = Number(v.toFixed(4));
      range.setAttribute("aria-valuetext", `${number.value} ${unit}`);
      inputs[name].value = v;
    };
    inputs[name] = { value: start[name], set };
    range.addEventListener("input", () => { set(Math.round(range.value / step) * step); update(); });
    range.addEventListener("keydown", (e) => {
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: 10, PageDown: -10 }[e.key];
      if (!by) return;
      e.preventDefault();
      set(Math.min(high, Math.max(low, inputs[name].value + by * step)));
      update();
    });
    number.addEventListener("change", () => {
      if (number.value !== "") set(number.value);
      update();
    });
    set(start[name]);
  }

  function parameters() {
    const p = { camera };
    for (const [name, input] of Object.entries(inputs)) p[name] = input.value;
    return p;
  }

  function tile(label, value, note) {
    return `<div><dt>${label}</dt><dd>${value}${note ? ` <small>${note}</small>` : ""}</dd></div>`;
  }

  function showTiles(p, out) {
    const allowed = out.allowed_tilt_deg === null ? "none" : `${out.allowed_tilt_deg.toFixed(4)}°`;
    const tiles = [
      tile("Paper's equation", length(out.paper_equation_mm)),
      tile("Largest radial error, exact", length(out.max_radial_mm)),
      tile("Largest distance of points", length(out.max_euclidean_mm)),
      tile("Ring's centre off the axis", length(out.ring_centre_shift_mm)),
      tile("Ring's radius change", length(out.ring_radius_change_mm)),
      tile(`Tilt allowed for ${length(p.accuracy_mm)}`, allowed),
    ];
    if (out.image) {
      tiles.push(tile("Ring inside the image", `${(100 * out.visible_share).toFixed(0)} %`));
      tiles.push(tile("Largest shift in the image", `${out.max_image_shift_px.toFixed(2)} px`));
    }
    $("tiles").innerHTML = tiles.join("");
    $("spoken").textContent = `Largest radial error ${length(out.max_radial_mm)}, allowed tilt ${allowed}`;
  }

  function showFacts(p, out) {
    const r = p.diameter_mm / 2, tilt = boresight.rad(p.tilt_deg);
    const near = boresight.paperError(r, p.baseline_mm, tilt), far = -boresight.paperError(r, p.baseline_mm, tilt, Math.PI);
    $("fact-side").innerHTML = `For a centred probe the equation's <strong>${length(near)}</strong> is the side toward which the sheet leans. On the opposite
      side the denominator is 1 − tanθ tanφ and the radius is read <strong>${length(far)}</strong> too large.`;
    const b = start.implied_baseline;
    $("fact-baseline").innerHTML = `“0.1 mm on a 4 inch pipe needs φ below 0.05°” holds at a baseline of
      <strong>${b.radial_mm.toFixed(1)} mm</strong> if the error is radial, or <strong>${b.euclidean_mm.toFixed(1)} mm</strong> if it is the distance of eq. (3).
      With l = ${p.baseline_mm.toFixed(1)} mm and this pipe the limit for ${length(p.accuracy_mm)} is <strong>${out.allowed_tilt_deg === null ? "out of reach" : `${out.allowed_tilt_deg.toFixed(4)}°`}</strong>.`;
    const left = Math.max(...leftOver(out).map((q) => Math.abs(q[1])));
    $("fact-shift").innerHTML = `Single points are off by up to <strong>${length(out.max_radial_mm)}</strong>, but the fitted circle is moved by
      <strong>${length(out.ring_centre_shift_mm)}</strong>, its radius changes by <strong>${um(out.ring_radius_change_mm)}</strong>, and all that is left in shape is
      <strong>${um(left)}</strong>. One ring cannot tell a small tilt from an off-centre probe: it takes several diameters, an off-centre sweep, or texture.`;
  }

  const byAzimuth = (ring, value) => ring
    .map((q) => [boresight.deg(Math.atan2(Math.sin(q.psi), Math.cos(q.psi))), value(q)])
    .sort((a, b) => a[0] - b[0]);
  const leftOver = (out) => byAzimuth(out.ring, (q) => Math.hypot(q.ax - out.circle.cx, q.ay - out.circle.cy) - out.circle.r);

  function ticks(low, high, n) {
    const raw = (high - low) / n, ten = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((k) => k * ten).find((s) => s >= raw);
    const out = [];
    for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step) out.push(Math.abs(t) < 1e-12 ? 0 : t);
    return { values: out, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }

  function lineChart(id, spec) {
    const W = 640, H = 440, left = 72, right = 16, top = 14 + 20 * Math.ceil(spec.series.length / 2), bottom = 52;
    const X = (x) => left + ((x - spec.x[0]) / (spec.x[1] - spec.x[0])) * (W - left - right);
    const Y = (y) => H - bottom - ((y - spec.y[0]) / (spec.y[1] - spec.y[0])) * (H - top - bottom);
    const xt = spec.xTicks ? { values: spec.xTicks, digits: 0 } : ticks(spec.x[0], spec.x[1], 6), yt = ticks(spec.y[0], spec.y[1], 6);
    const parts = [];
    for (const y of yt.values) {
      parts.push(`<line class="grid" x1="${left}" x2="${W - right}" y1="${Y(y)}" y2="${Y(y)}"/>`);
      parts.push(`<text x="${left - 8}" y="${Y(y) + 5}" text-anchor="end">${y.toFixed(yt.digits)}</text>`);
    }
    for (const x of xt.values) parts.push(`<text x="${X(x)}" y="${H - bottom + 20}" text-anchor="middle">${x.toFixed(xt.digits)}</text>`);
    parts.push(`<line class="axis" x1="${left}" x2="${W - right}" y1="${Y(Math.max(spec.y[0], 0))}" y2="${Y(Math.max(spec.y[0], 0))}"/>`);
    for (const rule of spec.rules || []) {
      const at = rule.y !== undefined ? `x1="${left}" x2="${W - right}" y1="${Y(rule.y)}" y2="${Y(rule.y)}"` : `x1="${X(rule.x)}" x2="${X(rule.x)}" y1="${top}" y2="${H - bottom}"`;
      parts.push(`<line class="rule" ${at}/>`);
      if (rule.y !== undefined) parts.push(`<text x="${W - right - 4}" y="${Y(rule.y) - 5}" text-anchor="end">${rule.label}</text>`);
      else parts.push(`<text x="${X(rule.x) + (rule.x > (spec.x[0] + spec.x[1]) / 2 ? -5 : 5)}" y="${top + 12}" text-anchor="${rule.x > (spec.x[0] + spec.x[1]) / 2 ? "end" : "start"}">${rule.label}</text>`);
    }
    parts.push(`<clipPath id="${id}-clip"><rect x="${left}" y="${top}" width="${W - left - right}" height="${H - top - bottom}"/></clipPath>`);
    spec.series.forEach((s, i) => {
      const path = s.points.filter((q) => q[1] !== null).map((q, k) => `${k ? "L" : "M"}${X(q[0]).toFixed(1)} ${Y(q[1]).toFixed(1)}`).join("");
      parts.push(`<path class="${s.style}" d="${path}" clip-path="url(#${id}-clip)"/>`);
      const x = left + (i % 2) * 285, y = 16 + 20 * Math.floor(i / 2);
      parts.push(`<path class="${s.style}" d="M${x} ${y - 5}h28"/><text x="${x + 34}" y="${y}">${s.label}</text>`);
    });
    parts.push(`<text x="${(left + W - right) / 2}" y="${H - 8}" text-anchor="middle">${spec.xLabel}</text>`);
    parts.push(`<text transform="translate(16 ${(top + H - bottom) / 2}) rotate(-90)" text-anchor="middle">${spec.yLabel}</text>`);
    $(id).innerHTML = `<title>${spec.title}</title>${parts.join("")}`;
    $(id).setAttribute("aria-label", spec.title);
  }

  function span(values, floor) {
    const high = Math.max(floor, ...values), low = Math.min(-floor, ...values), pad = 0.06 * (high - low);
    return [low - pad, high + pad];
  }

  function drawAround(p, out) {
    const r = p.diameter_mm / 2, direction = boresight.rad(p.tilt_direction_deg), tilt = boresight.rad(p.tilt_deg);
    const exact = byAzimuth(out.ring, (q) => q.radial), distance = byAzimuth(out.ring, (q) => q.euclidean);
    const paper = byAzimuth(out.ring, (q) => -boresight.paperError(r, p.baseline_mm, tilt, q.psi - direction));
    const first = byAzimuth(out.ring, (q) => (-r * r * Math.tan(tilt) * Math.cos(q.psi - direction)) / p.baseline_mm);
    lineChart("around", {
      title: `Radial error around the ring, at most ${length(out.max_radial_mm)}`, x: [-180, 180], xTicks: [-180, -90, 0, 90, 180],
      y: span([...exact, ...distance, ...paper].map((q) => q[1]), 1e-3), xLabel: "azimuth ψ in the camera's frame, °", yLabel: "error, mm",
      rules: [{ x: p.tilt_direction_deg, label: "leans forward" }],
      series: [
        { points: exact, style: "s-true", label: "radial, exact" },
        { points: paper, style: "s-read dash", label: "paper's equation at ψ" },
        { points: distance, style: "s-third", label: "distance of points, eq. (3)" },
        { points: first, style: "s-muted dots", label: "first order, −(r²/l) φ cos ψ" },
      ],
    });
  }

  function drawOverTilt(p, out) {
    const top = Math.max(1, Math.ceil(p.tilt_deg * 1.25 * 10) / 10), tilts = Array.from({ length: 41 }, (_, i) => (top * i) / 40);
    const curve = (q) => boresight.errorOverTilt(q, tilts).map((e, i) => [tilts[i], e]);
    const sizes = [[50.8, "2 inch", "s-third dots"], [76.2, "3 inch", "s-read dash"], [101.6, "4 inch", "s-muted"]];
    const fits = sizes.filter(([d]) => Math.hypot(p.offset_x_mm, p.offset_y_mm) < d / 2);
    const series = fits.map(([d, label, style]) => ({ points: curve({ ...p, diameter_mm: d }), style, label }));
    series.push({ points: curve(p), style: "s-true", label: `this pipe, ${p.diameter_mm.toFixed(1)} mm` });
    const highest = Math.max(...series.flatMap((s) => s.points.map((q) => q[1] ?? 0)));
    const rules = [{ y: p.accuracy_mm, label: `wished ${length(p.accuracy_mm)}` }, { x: p.tilt_deg, label: `φ = ${p.tilt_deg.toFixed(2)}°` }];
    lineChart("over-tilt", {
      title: `Largest radial error over tilt at baseline ${p.baseline_mm.toFixed(1)} mm`, x: [0, top], y: [0, Math.max(highest, p.accuracy_mm) * 1.06],
      xLabel: `tilt φ, °  (baseline ${p.baseline_mm.toFixed(1)} mm)`, yLabel: "largest radial error, mm", rules, series,
    });
  }

  function drawLeftOver(p, out) {
    const left = leftOver(out).map(([a, v]) => [a, 1000 * v]);
    lineChart("left-over", {
      title: `Shape left after the circle fit, at most ${um(Math.max(...left.map((q) => Math.abs(q[1]))) / 1000)}`, x: [-180, 180], xTicks: [-180, -90, 0, 90, 180],
      y: span(left.map((q) => q[1]), 0.1), xLabel: "azimuth ψ in the camera's frame, °", yLabel: "distance from the circle, µm",
      series: [{ points: left, style: "s-true", label: "triangulated ring minus its circle" }],
    });
  }

  function drawImage(out) {
    $("image-figure").hidden = !out.image;
    if (!out.image) return;
    const [w, h] = camera.image_size, k = Math.min(620 / w, 380 / h), x0 = (640 - k * w) / 2, y0 = 40 + (390 - k * h) / 2;
    const path = (name) => out.image.uv.map((q) => q[name]).filter(Boolean).map(([u, v], i) => `${i ? "L" : "M"}${(x0 + k * u).toFixed(1)} ${(y0 + k * v).toFixed(1)}`).join("");
    const title = `Ring in the image, moved by at most ${out.max_image_shift_px.toFixed(2)} px`;
    $("image").innerHTML = `<title>${title}</title><rect class="axis" fill="none" x="${x0}" y="${y0}" width="${k * w}" height="${k * h}"/>
      <path class="s-true" d="${path("expected")}Z"/><path class="s-read dash" d="${path("real")}Z"/>
      <path class="s-true" d="M${x0} 18h28"/><text x="${x0 + 34}" y="23">plane as assumed</text><path class="s-read dash" d="M${x0 + 230} 18h28"/><text x="${x0 + 264}" y="23">sheet as it is</text>`;
    $("image").setAttribute("aria-label", title);
    const shift = out.ring.map((q, i) => [q, out.image.uv[i]]).filter(([, uv]) => uv.real && uv.expected)
      .map(([q, { real, expected }]) => {
        const [du, dv] = [real[0] - expected[0], real[1] - expected[1]];
        return [boresight.deg(Math.atan2(q.y, q.x)), du * Math.cos(q.psi) + dv * Math.sin(q.psi)];
      }).sort((a, b) => a[0] - b[0]);
    lineChart("image-shift", {
      title: "Outward shift of the ring in the image", x: [-180, 180], xTicks: [-180, -90, 0, 90, 180], y: span(shift.map((q) => q[1]), 0.05),
      xLabel: "azimuth ψ in the camera's frame, °", yLabel: "shift, px", series: [{ points: shift, style: "s-true", label: "sheet as it is minus plane as assumed, outward" }],
    });
  }

  function drawRing(p, out) {
    const canvas = $("ring3d"), g = canvas.getContext("2d"), css = getComputedStyle(document.documentElement);
    const colour = (name) => css.getPropertyValue(name).trim(), scale = 150 / (p.diameter_mm / 2), times = Number($("exaggerate").value);
    const density = Math.min(2, window.devicePixelRatio || 1);
    canvas.width = 640 * density;
    canvas.height = 440 * density;
    g.scale(density, density);
    const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw), cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
    const flat = (x, y, z) => {
      const X = x * cy + (z - p.baseline_mm) * sy, Z = -x * sy + (z - p.baseline_mm) * cy;
      return [320 + scale * X, 215 + scale * (y * cp - Z * sp)];
    };
    const line = (points, stroke, width, dash = []) => {
      g.beginPath();
      points.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
      g.strokeStyle = colour(stroke);
      g.lineWidth = width;
      g.setLineDash(dash);
      g.stroke();
    };
    const R = p.diameter_mm / 2, ex = -p.offset_x_mm, ey = -p.offset_y_mm, behind = p.baseline_mm - 0.75 * R, ahead = p.baseline_mm + 0.75 * R;
    const circle = (z) => Array.from({ length: 73 }, (_, i) => flat(ex + R * Math.cos((i * Math.PI) / 36), ey + R * Math.sin((i * Math.PI) / 36), z));
    for (const z of [behind, ahead]) line(circle(z), "--line", 1.5);
    for (let i = 0; i < 12; i++) {
      const a = (i * Math.PI) / 6, x = ex + R * Math.cos(a), y = ey + R * Math.sin(a);
      line([flat(x, y, behind), flat(x, y, ahead)], "--line", 1);
    }
    const lifted = out.ring.map((q) => flat(q.x, q.y, p.baseline_mm + times * (q.z - p.baseline_mm)));
    g.beginPath();
    lifted.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
    g.fillStyle = colour("--sheet");
    g.fill();
    line([...lifted, lifted[0]], "--true", 2.5);
    const read = out.ring.map((q) => flat(q.x + times * (q.ax - q.x), q.y + times * (q.ay - q.y), p.baseline_mm));
    line([...read, read[0]], "--read", 2.5, [8, 5]);
    line([flat(0, 0, 0), flat(0, 0, p.baseline_mm)], "--muted", 1.5, [3, 4]);
    const [u, v] = flat(0, 0, 0);
    g.setLineDash([]);
    g.fillStyle = colour("--text");
    g.beginPath();
    g.arc(u, v, 4, 0, 7);
    g.fill();
    g.font = "13px system-ui, sans-serif";
    g.fillText("camera", u + 7, v - 6);
    canvas.setAttribute("aria-label", `3D view: ring on the wall and triangulated ring, up to ${length(out.max_radial_mm)} apart in radius; turn it with the arrow keys`);
  }

  function update() {
    const p = parameters(), out = boresight.compute(p);
    $("problem").textContent = out.problem || "";
    $("camera-name").textContent = camera ? `${cameraName}: ${camera.label || camera.model}, ${camera.image_size.join(" × ")} px` : "No camera file: the ring is taken as seen in full.";
    if (out.problem) return;
    showTiles(p, out);
    showFacts(p, out);
    drawAround(p, out);
    drawOverTilt(p, out);
    drawLeftOver(p, out);
    drawImage(out);
    drawRing(p, out);
  }

  async function loadCamera(file) {
    try {
      const probe = boresight.parseProbe(await file.text());
      [camera, cameraName] = [probe.camera, file.name];
      for (const [name, value] of Object.entries(probe.laser)) if (value !== null && inputs[name]) inputs[name].set(value);
      $("camera-problem").textContent = "";
    } catch (error) {
      $("camera-problem").textContent = `${file.name}: ${error.message}`;
    }
    update();
  }

  function turn(dx, dy) {
    view.yaw += dx;
    view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + dy));
    const p = parameters(), out = boresight.compute(p);
    if (!out.problem) drawRing(p, out);
  }

  function watchRing() {
    const canvas = $("ring3d");
    let last = null;
    canvas.addEventListener("pointerdown", (e) => { last = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointermove", (e) => {
      if (!last) return;
      turn((e.clientX - last[0]) / 150, (e.clientY - last[1]) / 150);
      last = [e.clientX, e.clientY];
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { last = null; });
    canvas.addEventListener("keydown", (e) => {
      const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[e.key];
      if (!by) return;
      e.preventDefault();
      turn(...by);
    });
  }

  function watchTheme() {
    const dark = () => {
      const set = document.documentElement.dataset.theme;
      return set ? set === "dark" : window.matchMedia("(prefers-color-scheme: dark)").matches;
    };
    const button = $("theme"), show = () => button.setAttribute("aria-pressed", String(dark()));
    button.addEventListener("click", () => { document.documentElement.dataset.theme = dark() ? "light" : "dark"; show(); update(); });
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { show(); update(); });
    show();
  }

  document.querySelectorAll(".slider").forEach(buildSlider);
  document.querySelectorAll("[data-diameter]").forEach((b) => b.addEventListener("click", () => { inputs.diameter_mm.set(b.dataset.diameter); update(); }));
  $("camera-file").addEventListener("change", (e) => e.target.files[0] && loadCamera(e.target.files[0]));
  $("exaggerate").addEventListener("change", update);
  $("controls").addEventListener("submit", (e) => e.preventDefault());
  $("reset").addEventListener("click", () => { for (const name of Object.keys(inputs)) inputs[name].set(start[name]); [camera, cameraName] = [start.camera, start.camera_name]; update(); });
  watchRing();
  watchTheme();
  update();
})();
