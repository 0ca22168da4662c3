/** The unrolled wall: distance to the right, clock downward from 6 over 12 to 6, tiles loaded as they are seen. */
import { FlatMarks, type Plane } from "./flat_marks";
import { Pinch } from "./graphics";
import type { Session } from "./session";
import { TileLayer, type Ground } from "./tiles";
import type { Point } from "./types";
import { TURN, element } from "./words";

const TOP = -1.5 * Math.PI; // 6 o'clock
const GRAB_PX = 12;

interface View { distance: number; azimuth: number; mmPerPx: number }

export class FlatView implements Plane {
  readonly root: HTMLElement;
  private readonly canvas = element("canvas", {
    tabindex: "0", role: "img",
    "aria-label": "Unrolled wall. Arrow keys move the spot, plus and minus zoom; with a tool, Enter sets a point, Backspace takes it back.",
  });
  private readonly picture: TileLayer;
  private view: View;
  private drag: { x: number; y: number; view: View; moved: boolean; corner: number } | null = null;
  private readonly pinch = new Pinch();

  constructor(private readonly session: Session) {
    this.root = element("div", { class: "flat" }, this.canvas);
    const { run } = session;
    this.picture = new TileLayer(session.source, () => this.paint());
    this.view = { distance: session.cursor[0], azimuth: TOP + Math.PI, mmPerPx: (TURN * run.radius_mm) / 320 };
    session.on(["layer", "limits"], () => this.load());
    session.on(["state", "selection", "shape", "tool"], () => this.paint());
    session.on(["cursor"], () => this.follow());
    session.on(["selection"], () => this.reveal());
    new ResizeObserver(() => this.resize()).observe(this.root);
    this.canvas.addEventListener("pointerdown", (e) => this.press(e));
    this.canvas.addEventListener("pointermove", (e) => this.move(e));
    this.canvas.addEventListener("pointerup", (e) => this.release(e));
    this.canvas.addEventListener("pointercancel", (e) => { this.pinch.up(e); this.drag = null; });
    this.canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    this.canvas.addEventListener("keydown", (e) => this.key(e));
    this.load();
  }

  get mmPerPx(): number { return this.view.mmPerPx; }
  private get perRad(): number { return this.session.run.radius_mm / this.view.mmPerPx; }
  get size(): [number, number] { return [this.canvas.clientWidth, this.canvas.clientHeight]; }

  x(distance: number): number { return this.size[0] / 2 + (distance - this.view.distance) / this.view.mmPerPx; }
  y(azimuth: number): number { return this.size[1] / 2 + (azimuth - this.view.azimuth) * this.perRad; }

  point(x: number, y: number): Point {
    return [
      this.view.distance + (x - this.size[0] / 2) * this.view.mmPerPx,
      this.view.azimuth + (y - this.size[1] / 2) / this.perRad,
    ];
  }

  private load(): void {
    this.picture.load(this.session.layer, this.session.source.readOnly ? null : this.session.limits()).catch((error: Error) => this.session.say(error.message));
  }

  private get ground(): Ground {
    const span: Point = [this.point(0, 0)[0], this.point(this.size[0], 0)[0]];
    return { x: (s) => this.x(s), y: (a) => this.y(a), size: this.size, span, mmPerPx: this.view.mmPerPx };
  }

  private resize(): void {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [this.root.clientWidth, this.root.clientHeight];
    if (!width || !height) return;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.view.mmPerPx = Math.min(this.view.mmPerPx, (TURN * this.session.run.radius_mm) / height);
    this.paint();
  }

  /** Keep the chosen place in view, from wherever it was moved. */
  private follow(): void {
    const [distance, azimuth] = this.session.cursor;
    const [x, turns] = [this.x(distance), [-TURN, 0, TURN].map((t) => this.y(azimuth + t))];
    if (x < 0 || x > this.size[0]) this.view.distance = distance;
    if (!turns.some((y) => y >= 0 && y <= this.size[1])) { this.view.azimuth = azimuth; this.keepInside(); }
    this.paint();
  }

  private reveal(): void {
    const found = this.session.finding;
    if (!found) return;
    const spans = found.outline.map((p) => p[0]);
    const long = Math.max(...spans) - Math.min(...spans);
    const turn = Math.max(...found.outline.map((p) => p[1])) - Math.min(...found.outline.map((p) => p[1]));
    const whole = (TURN * this.session.run.radius_mm) / Math.max(this.size[1], 1);
    const fit = Math.max((long * 3) / this.size[0], (turn * this.session.run.radius_mm * 3) / this.size[1], 0.05);
    this.view = { distance: this.session.cursor[0], azimuth: this.session.cursor[1], mmPerPx: Math.min(whole, fit) };
    this.keepInside();
    this.paint();
  }

  private keepInside(): void {
    const half = (this.size[1] / 2) / this.perRad;
    this.view.azimuth = half * 2 >= TURN ? TOP + Math.PI
      : Math.min(Math.max(this.view.azimuth < TOP ? this.view.azimuth + TURN : this.view.azimuth, TOP + half - Math.PI),
        TOP + TURN + Math.PI - half);
  }

  private paint(): void {
    const context = this.canvas.getContext("2d");
    if (!context || !this.picture.layer) return;
    const ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const [width, height] = this.size;
    const style = getComputedStyle(this.root);
    context.fillStyle = style.getPropertyValue("--ground");
    context.fillRect(0, 0, width, height);
    this.picture.paint(context, this.ground);
    new FlatMarks(context, this.session, this, style).paint();
  }

  private press(event: PointerEvent): void {
    this.canvas.setPointerCapture(event.pointerId);
    this.pinch.down(event);
    this.drag = { x: event.offsetX, y: event.offsetY, view: { ...this.view }, moved: false, corner: this.cornerAt(event.offsetX, event.offsetY) };
  }

  private move(event: PointerEvent): void {
    const { spread } = this.pinch.move(event);
    if (!this.drag) return;
    if (this.pinch.isTwo) {
      this.drag.moved = true;
      this.zoom(Math.exp(-spread * 0.006), event.offsetX, event.offsetY);
      return;
    }
    const [dx, dy] = [event.offsetX - this.drag.x, event.offsetY - this.drag.y];
    this.drag.moved ||= Math.hypot(dx, dy) > 4;
    if (!this.drag.moved) return;
    if (this.drag.corner >= 0) { this.session.replace(this.drag.corner, this.point(event.offsetX, event.offsetY)); return; }
    this.view.distance = this.drag.view.distance - dx * this.view.mmPerPx;
    this.view.azimuth = this.drag.view.azimuth - dy / this.perRad;
    this.keepInside();
    this.paint();
  }

  /** The index of the drawn corner under a pixel, -1 where there is none. */
  private cornerAt(x: number, y: number): number {
    return this.session.drawn.findIndex(([s, a]) => Math.hypot(this.x(s) - x, this.y(a) - y) < GRAB_PX);
  }

  private release(event: PointerEvent): void {
    this.pinch.up(event);
    const clicked = this.drag && !this.drag.moved && this.drag.corner < 0;
    this.drag = null;
    if (clicked) this.pick(this.point(event.offsetX, event.offsetY));
  }

  private pick(at: Point): void {
    const { session } = this;
    if (session.tool !== "none") {
      session.draw(at);
      return;
    }
    const found = session.standing.find((f) => [-TURN, 0, TURN].some((t) => inside([at[0], at[1] + t], f.outline)));
    if (found) session.selected = found.id;
    session.moveTo(at);
    if (found) session.tell("selection");
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    this.zoom(Math.exp(event.deltaY * 0.0015), event.offsetX, event.offsetY);
  }

  private zoom(factor: number, x = this.size[0] / 2, y = this.size[1] / 2): void {
    const before = this.point(x, y);
    const whole = (TURN * this.session.run.radius_mm) / Math.max(this.size[1], 1);
    this.view.mmPerPx = Math.min(Math.max(this.view.mmPerPx * factor, 0.01), whole);
    const after = this.point(x, y);
    this.view.distance += before[0] - after[0];
    this.view.azimuth += before[1] - after[1];
    this.keepInside();
    this.paint();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [s, a] = this.session.cursor;
    const step = (event.shiftKey ? 40 : 4) * this.view.mmPerPx;
    const turn = step / this.session.run.radius_mm;
    const moves: Record<string, Point> = {
      ArrowLeft: [s - step, a], ArrowRight: [s + step, a], ArrowUp: [s, a - turn], ArrowDown: [s, a + turn],
    };
    const to = moves[event.key];
    if (to) {
      this.session.moveTo(to);
      this.view.distance = this.session.cursor[0];
      this.paint();
    } else if (event.key === "+" || event.key === "=") this.zoom(0.7);
    else if (event.key === "-") this.zoom(1.4);
    else if (event.key === "Enter" && this.session.tool !== "none") this.session.draw([s, this.session.beside(a)]);
    else if (event.key === "Backspace" && this.session.drawn.length) {
      this.session.drawn = this.session.drawn.slice(0, -1);
      this.session.tell("shape");
    } else return;
    event.preventDefault();
  }
}

function inside([s, a]: Point, outline: Point[]): boolean {
  let hit = false;
  for (let k = 0, j = outline.length - 1; k < outline.length; j = k++) {
    const [s0, a0] = outline[k]!, [s1, a1] = outline[j]!;
    if (a0 > a !== a1 > a && s < ((s1 - s0) * (a - a0)) / (a1 - a0) + s0) hit = !hit;
  }
  return hit;
}
