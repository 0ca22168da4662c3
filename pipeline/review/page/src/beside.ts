/** The same piece of wall in both runs: side by side, with a movable divider between them, or as their difference. */
import { colourBar } from "./legend";
import type { Session } from "./session";
import { TileLayer, type Ground } from "./tiles";
import type { Change, Comparison, Overlay, Point } from "./types";
import { CHOSEN_COLOUR, TURN, clock, element, number, wrapped } from "./words";

type Way = "swipe" | "beside" | "difference" | "difference_sigma";
const WAYS: [Way, string][] = [["swipe", "Swipe"], ["beside", "Side by side"], ["difference", "Difference, later minus earlier"], ["difference_sigma", "1 σ of the difference"]];
const LAYERS: [string, string][] = [["photo", "Photo"], ["deviation", "Deviation from the fitted pipe"]];
const [CASING, NOW, THEN, CURSOR] = ["#000000", "#ffffff", "#7cc7ff", CHOSEN_COLOUR];
const GAP_PX = 4;

export class CompareView {
  readonly root: HTMLElement;
  private readonly canvas = element("canvas", {
    tabindex: "0", role: "img", "aria-label": "The wall in both runs. Arrow keys move the spot, plus and minus zoom, comma and full stop move the wipe.",
  });
  private readonly box = element("div", { class: "flat compared" }, this.canvas);
  private readonly way = element("select", { "aria-label": "how to compare" }, ...WAYS.map(([value, name]) => element("option", { value }, name)));
  private readonly layer = element("select", { "aria-label": "what is shown" }, ...LAYERS.map(([value, name]) => element("option", { value }, name)));
  private readonly wipe = element("input", { type: "range", min: "0", max: "100", value: "50", id: "wipe" });
  private readonly told = element("p", { class: "told", role: "status" });
  private readonly legend = element("span", { class: "legend" });
  private readonly now: TileLayer;
  private readonly then: TileLayer;
  private readonly apart: TileLayer;
  private found: Comparison;
  private view = { distance: 0, azimuth: -Math.PI / 2, mmPerPx: 0.2 };
  private drag: { x: number; y: number; distance: number; azimuth: number; moved: boolean } | null = null;

  constructor(private readonly session: Session, found: Comparison) {
    this.found = found;
    [this.now, this.then, this.apart] = [0, 1, 2].map(() => new TileLayer(session.source, () => this.paint())) as [TileLayer, TileLayer, TileLayer];
    const label = element("label", { for: "wipe" }, `${found.earlier} `, this.wipe, ` ${session.run.name}`);
    this.root = element("section", { id: "view-compare" }, element("div", { class: "head" }, element("h2", {}, "The wall in both runs"),
      element("div", { class: "bar" }, this.way, this.layer, label, this.legend)), this.box, this.told);
    this.way.addEventListener("change", () => this.load());
    this.layer.addEventListener("change", () => this.load());
    this.wipe.addEventListener("input", () => this.paint());
    session.on(["limits"], () => this.load());
    session.on(["cursor"], () => { this.follow(); this.tell(); this.paint(); });
    new ResizeObserver(() => this.resize()).observe(this.box);
    this.canvas.addEventListener("pointerdown", (e) => this.press(e));
    this.canvas.addEventListener("pointermove", (e) => this.move(e));
    this.canvas.addEventListener("pointerup", (e) => this.release(e));
    this.canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoom(Math.exp(e.deltaY * 0.0015)); }, { passive: false });
    this.canvas.addEventListener("keydown", (e) => this.key(e));
    const first = found.changes.find((c) => c.changed) ?? found.changes[0];
    if (first) this.show(first); else this.view.distance = session.cursor[0];
    this.load();
  }

  /** Show newer results of the same two runs. */
  take(found: Comparison): void { this.found = found; this.paint(); }

  show(change: Change): void {
    this.view = { distance: change.distance_mm, azimuth: wrapped(change.azimuth_rad), mmPerPx: (4 * change.half_mm) / Math.max(this.size[1], 200) };
    if (change.id && this.session.standing.some((f) => f.id === change.id)) this.session.select(change.id);
    this.session.moveTo([change.distance_mm, change.azimuth_rad]);
  }

  private get mode(): Way { return this.way.value as Way; }
  private get size(): [number, number] { return [this.canvas.clientWidth, this.canvas.clientHeight]; }
  private get perRad(): number { return this.session.run.radius_mm / this.view.mmPerPx; }
  /** Left edge and width of one of the two pictures; both fill the canvas unless they are side by side. */
  private frame(side: 0 | 1): [number, number] {
    const width = this.size[0];
    return this.mode === "beside" ? [side ? width / 2 + GAP_PX / 2 : 0, width / 2 - GAP_PX / 2] : [0, width];
  }

  private load(): void {
    const { mode } = this, apart = mode === "difference" || mode === "difference_sigma";
    this.layer.disabled = apart;
    this.wipe.disabled = mode !== "swipe";
    const wanted: [TileLayer, string][] = apart ? [[this.apart, mode]] : [[this.now, this.layer.value], [this.then, `earlier-${this.layer.value}`]];
    const limits = apart ? null : this.session.source.readOnly ? null : this.session.limits(this.layer.value); // one for both runs
    for (const [layer, name] of wanted) layer.load(name, limits).catch((error: Error) => this.session.say(error.message));
    const shown = (apart ? this.found.overlays : this.session.run.overlays).find((o) => o.name === (apart ? mode : this.layer.value));
    this.legend.replaceChildren(...(shown ? legend(shown, limits ?? [shown.low_mm, shown.high_mm]) : []));
    this.paint();
  }

  /** Fill the view with wall, in both halves, as far as it was measured. */
  private keepInside(): void {
    const [from, to] = this.session.run.distance_mm, width = this.frame(1)[1];
    this.view.mmPerPx = Math.min(this.view.mmPerPx, (to - from) / width);
    const half = (width / 2) * this.view.mmPerPx;
    this.view.distance = Math.min(Math.max(this.view.distance, from + half), to - half);
  }

  private follow(): void {
    const [s, a] = this.session.cursor, half = (this.frame(1)[1] / 2) * this.view.mmPerPx;
    if (Math.abs(s - this.view.distance) > half * 0.9) this.view.distance = s;
    if (Math.abs(wrapped(a - this.view.azimuth)) * this.perRad > this.size[1] * 0.45) this.view.azimuth = a;
  }

  private tell(): void {
    const [s, a] = this.session.cursor, there = this.before(s);
    this.told.textContent = `${number(s, 1)} mm, ${clock(a)}; in ${this.found.earlier}: ${number(there, 1)} mm, ${clock(a - this.rollAt(there))}. White outlines: this run; blue, dashed: the earlier one.`;
  }

  private resize(): void {
    const ratio = window.devicePixelRatio || 1;
    if (!this.box.clientWidth || !this.box.clientHeight) return;
    [this.canvas.width, this.canvas.height] = [Math.round(this.box.clientWidth * ratio), Math.round(this.box.clientHeight * ratio)];
    this.paint();
  }

  private rollAt(earlier: number): number { return between(earlier, this.found.registration.at_mm, this.found.registration.roll_rad); }

  private after(earlier: number): number {
    const r = this.found.registration, [first, last] = [r.at_mm[0]!, r.at_mm[r.at_mm.length - 1]!];
    const beyond = earlier - Math.min(Math.max(earlier, first), last);
    return earlier + between(earlier, r.at_mm, r.shift_mm) + (r.scale - 1) * beyond;
  }

  private before(now: number): number {
    const r = this.found.registration, at = r.at_mm.map((s, k) => s + r.shift_mm[k]!);
    return between(now, at, r.at_mm) + (now - Math.min(Math.max(now, at[0]!), at[at.length - 1]!)) / r.scale;
  }

  private ground(side: 0 | 1, isEarlier: boolean): Ground {
    const [left, width] = this.frame(side), { view } = this;
    const x = (s: number) => left + width / 2 + (s - view.distance) / view.mmPerPx;
    const y = (a: number) => this.size[1] / 2 + (a - view.azimuth) * this.perRad;
    const half = (width / 2) * view.mmPerPx, seen: Point = [view.distance - half, view.distance + half];
    const own = { size: this.size, mmPerPx: view.mmPerPx };
    if (!isEarlier) return { ...own, x, y, span: seen };
    const turned = (s: number) => wrapped(this.rollAt(s));
    return { ...own, x: (s) => x(this.after(s)), y: (a, s) => y(a + turned(s)), span: [this.before(seen[0]), this.before(seen[1])] };
  }

  private paint(): void {
    const context = this.canvas.getContext("2d");
    if (!context || !this.size[0]) return;
    this.keepInside();
    const ratio = window.devicePixelRatio || 1, style = getComputedStyle(this.root), width = this.size[0];
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = style.getPropertyValue("--ground");
    context.fillRect(0, 0, ...this.size);
    const wiped = (width * Number(this.wipe.value)) / 100;
    if (this.mode === "beside") {
      this.part(context, 0, width / 2 - GAP_PX / 2, this.then, 0, true);
      this.part(context, width / 2 + GAP_PX / 2, width, this.now, 1, false);
    } else if (this.mode === "swipe") {
      this.part(context, 0, wiped, this.then, 0, true);
      this.part(context, wiped, width, this.now, 1, false);
      this.rule(context, wiped);
    } else this.part(context, 0, width, this.apart, 1, false);
  }

  /** One run's picture between two edges, with the outlines of both and the cursor. */
  private part(context: CanvasRenderingContext2D, from: number, to: number, layer: TileLayer, side: 0 | 1, isEarlier: boolean): void {
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, this.size[1]);
    context.clip();
    layer.paint(context, this.ground(side, isEarlier));
    const ground = this.ground(side, false);
    for (const change of this.found.changes) this.outline(context, ground, change);
    this.cross(context, ground);
    if (this.mode === "beside" || this.mode === "swipe") this.caption(context, isEarlier ? from + 8 : to - 8, isEarlier);
    context.restore();
  }

  private outline(context: CanvasRenderingContext2D, ground: Ground, change: Change): void {
    change.outlines.forEach((outline, k) => {
      const isEarlier = change.id === null || k === 1;
      context.setLineDash(isEarlier ? [5, 4] : []);
      for (const turn of [-TURN, 0, TURN]) {
        context.beginPath();
        outline.forEach(([s, a], n) => context[n ? "lineTo" : "moveTo"](ground.x(s), ground.y(a + turn, s)));
        context.closePath();
        this.cased(context, isEarlier ? THEN : NOW, change.changed ? 2.4 : 1.4);
      }
    });
    context.setLineDash([]);
  }

  private cross(context: CanvasRenderingContext2D, ground: Ground): void {
    const [s, a] = this.session.cursor;
    context.beginPath();
    for (const turn of [-TURN, 0, TURN]) {
      const [x, y] = [Math.round(ground.x(s)) + 0.5, Math.round(ground.y(a + turn, s)) + 0.5];
      for (const [dx, dy] of [[14, 0], [0, 14]] as Point[]) {
        context.moveTo(x - dx, y - dy);
        context.lineTo(x - dx / 3, y - dy / 3);
        context.moveTo(x + dx / 3, y + dy / 3);
        context.lineTo(x + dx, y + dy);
      }
    }
    this.cased(context, CURSOR, 1.4);
  }

  private rule(context: CanvasRenderingContext2D, x: number): void {
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, this.size[1]);
    this.cased(context, CURSOR, 2);
  }

  private caption(context: CanvasRenderingContext2D, x: number, isEarlier: boolean): void {
    context.font = `bold ${0.9 * parseFloat(getComputedStyle(this.root).fontSize)}px system-ui, sans-serif`;
    context.textAlign = isEarlier ? "left" : "right";
    context.textBaseline = "top";
    context.lineWidth = 4;
    context.strokeStyle = CASING;
    context.fillStyle = isEarlier ? THEN : NOW;
    const text = isEarlier ? this.found.earlier : this.session.run.name;
    context.strokeText(text, x, 8);
    context.fillText(text, x, 8);
  }

  private cased(context: CanvasRenderingContext2D, colour: string, width: number): void {
    for (const [paint, wide] of [[CASING, width + 2], [colour, width]] as [string, number][]) {
      context.strokeStyle = paint;
      context.lineWidth = wide;
      context.stroke();
    }
  }

  /** The place under a pixel; side by side, each half shows the same places. */
  private point(x: number, y: number): Point {
    const [left, width] = this.frame(x < this.size[0] / 2 ? 0 : 1), { view } = this;
    return [view.distance + (x - left - width / 2) * view.mmPerPx, view.azimuth + (y - this.size[1] / 2) / this.perRad];
  }

  private press(event: PointerEvent): void {
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { x: event.offsetX, y: event.offsetY, distance: this.view.distance, azimuth: this.view.azimuth, moved: false };
  }

  private move(event: PointerEvent): void {
    if (!this.drag) return;
    const [dx, dy] = [event.offsetX - this.drag.x, event.offsetY - this.drag.y];
    this.drag.moved ||= Math.hypot(dx, dy) > 4;
    if (!this.drag.moved) return;
    this.view.distance = this.drag.distance - dx * this.view.mmPerPx;
    this.view.azimuth = wrapped(this.drag.azimuth - dy / this.perRad);
    this.paint();
  }

  private release(event: PointerEvent): void {
    const clicked = this.drag && !this.drag.moved;
    this.drag = null;
    if (clicked) this.session.moveTo(this.point(event.offsetX, event.offsetY));
  }

  private zoom(factor: number): void {
    const whole = (TURN * this.session.run.radius_mm) / Math.max(this.size[1], 1);
    this.view.mmPerPx = Math.min(Math.max(this.view.mmPerPx * factor, 0.01), whole);
    this.paint();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [s, a] = this.session.cursor, step = (event.shiftKey ? 40 : 4) * this.view.mmPerPx, turn = step / this.session.run.radius_mm;
    const moves: Record<string, Point> = { ArrowLeft: [s - step, a], ArrowRight: [s + step, a], ArrowUp: [s, a - turn], ArrowDown: [s, a + turn] };
    const to = moves[event.key], wipes: Record<string, number> = { ",": -5, ".": 5 };
    if (to) this.session.moveTo(to);
    else if (event.key === "+" || event.key === "=") this.zoom(0.7);
    else if (event.key === "-") this.zoom(1.4);
    else if (event.key in wipes) {
      this.wipe.value = String(Number(this.wipe.value) + wipes[event.key]!);
      this.paint();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }
}

/** Linear between points, constant beyond the ends. */
function between(x: number, at: number[], values: number[]): number {
  const k = at.findIndex((s) => s >= x);
  if (k < 0) return values[values.length - 1]!;
  if (k === 0) return values[0]!;
  const share = (x - at[k - 1]!) / Math.max(at[k]! - at[k - 1]!, 1e-9);
  return values[k - 1]! + share * (values[k]! - values[k - 1]!);
}

function legend({ colours }: Overlay, [low, high]: Point): HTMLElement[] {
  return [element("span", {}, number(low)), colourBar(colours), element("span", {}, `${number(high)} mm`)];
}
