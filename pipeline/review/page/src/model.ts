/** The 3D model: every material variant, depth exaggerated, cut open, seen from outside or flown through. */
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { CoarseWall } from "./coarse";
import { Pace, Pinch, drawsPlainly, fromModel, toModel } from "./graphics";
import { layerChoice, legend } from "./legend";
import { END_RADII, Marks } from "./marks";
import { Pipe } from "./pipe";
import type { Session } from "./session";
import { Stretches } from "./stretches";
import { CHOSEN_COLOUR, element } from "./words";

const MM = 1e-3;
const FLIGHT_MM = 6;
const MOST_PIXELS = 1280 * 720;

// From outside, no more of a long pipe is shown than this many radii: it would be a thread.
const OUTSIDE_RADII = 16;
// The eye stands so far before the spot, in radii.
const BEFORE_RADII = 1.1;
const [FOV_INSIDE, FOV_NEAR, FOV_OUTSIDE] = [80, 52, 30];
const MARGIN = 1.12;
// Where the raking light stands behind the eye, in radii: it meets the wall beside the spot at about 12°, so that a slope of
// 0.1 changes its brightness by a third. Strengths make a flat wall there as bright as recorded.
const RAKING_RADII = 3.5;
const [AMBIENT, RAKING, SHINING] = [0.35 * Math.PI, 9.7, 0.6 * Math.PI];

export class ModelView {
  private readonly isPlain = drawsPlainly(); // first: it says how colours are to be understood
  readonly root = element("div", { class: "model" });
  readonly frameTimes: number[] = [];
  private readonly canvas = element("canvas", {
    tabindex: "0", role: "img", "aria-label": "Model of the pipe. Inside: W and S fly along it, A and D turn the view.",
  });
  private readonly told = element("p", { class: "veil" }, "Loading the model…");
  private readonly gain = element("input", { type: "range", min: "1", max: "20", value: "1", id: "gain" });
  private readonly gained = element("output", { for: "gain" }, "1×");
  private readonly cut = element("input", { type: "checkbox", id: "cut" });
  private readonly within = element("button", { "aria-pressed": "true", click: () => this.enter(true) }, "Inside");
  private readonly without = element("button", { "aria-pressed": "false", click: () => this.enter(false) }, "Outside");
  private readonly hint = element("p", { class: "hint view-hint" });
  private readonly raking = element("input", { type: "checkbox", id: "raking" });
  private isInside = true;
  private readonly pace = new Pace((sharpness) => this.sharpen(sharpness), () => this.draw());
  private readonly pipe: Pipe;
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.PerspectiveCamera(80, 1, 1e-3, 1000);
  private readonly lamp = new THREE.PointLight(0xffffff, RAKING, 0, 0);
  private readonly pinch = new Pinch();
  private readonly marks: Marks;
  private isStaying = false;
  private readonly marker = new THREE.Mesh(
    new THREE.TorusGeometry(1, 0.14, 8, 32), new THREE.MeshBasicMaterial({ color: CHOSEN_COLOUR, depthTest: false, transparent: true }));
  private readonly line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: CHOSEN_COLOUR, depthTest: false, transparent: true }));
  private readonly corners = new THREE.Points(
    new THREE.BufferGeometry(), new THREE.PointsMaterial({ color: CHOSEN_COLOUR, size: 9, sizeAttenuation: false, depthTest: false, transparent: true }));
  private readonly plane = new THREE.Plane(new THREE.Vector3(1, 0, 0), 0);
  private renderer: THREE.WebGLRenderer | null = null;
  private controls: OrbitControls | null = null;
  private readonly fine: Stretches;
  private readonly coarse: CoarseWall;
  private flown: number;
  private look = { yaw: 0, pitch: 0 };
  private asked = false;
  private seen = NaN; // where the eye was when stretches were last asked for
  private pressed: { x: number; y: number } | null = null;

  constructor(private readonly session: Session) {
    this.pipe = new Pipe(session.run.axis);
    this.flown = session.run.distance_mm[0];
    this.fine = new Stretches(session, this.pipe, this.isPlain, () => this.grown());
    this.coarse = new CoarseWall(session, this.pipe, this.isPlain, () => this.draw());
    this.marks = new Marks(session, this.pipe);
    const button = (name: string, title: string, click: () => void) => element("button", { title, click }, name);
    this.root.append(element("div", { class: "stage" }, this.canvas, this.marks.layer, this.told,
      element("div", { class: "over corner" }, button("Fit", "turn to the spot or the chosen finding", () => this.follow()),
        button("Home", "back to the start of the pipe", () => this.home()), button("Maximise", "the model alone, and back", () => this.maximise())),
      this.manner(), element("div", { class: "over foot" }, legend(session), this.hint)));
    this.marker.renderOrder = 1; // drawn after the wall, or the wall would cover it
    this.explain();
    session.on(["layer", "limits"], () => this.dress());
    session.on(["state", "selection"], () => { this.marks.around(this.eye, this.isInside, true); this.draw(); });
    session.on(["cursor"], () => this.follow());
    session.on(["shape"], () => this.trace());
    void this.start();
  }

  /** What stands beside the pane's title. */
  bar(): HTMLElement {
    return element("div", { class: "bar" },
      element("span", { class: "joined", role: "group", "aria-label": "where the model is seen from" }, this.within, this.without),
      element("label", {}, "shows ", layerChoice(this.session, "what the model shows")));
  }

  /** How the model is shown; it stands in the picture, where there is room. */
  private manner(): HTMLElement {
    this.gain.addEventListener("input", () => { this.gained.textContent = `${this.gain.value}×`; this.exaggerate(); });
    this.cut.addEventListener("change", () => this.draw());
    this.raking.addEventListener("change", () => { this.fine.dress(this.isLit); this.draw(); });
    return element("div", { class: "over manner" },
      element("label", { for: "raking", title: "light along the wall: dents and pits throw shadows" }, this.raking, " raking light"),
      element("label", { for: "cut", title: "take away the half toward the viewer" }, this.cut, " cut open"),
      element("label", { for: "gain", title: "exaggerate how far the wall leaves the round pipe" }, "relief ", this.gain, " ", this.gained));
  }

  private get isLit(): boolean { return this.raking.checked || !this.isInside; }

  private enter(inside: boolean): void {
    this.isInside = inside;
    this.fine.dress(this.isLit);
    this.stand();
    this.explain();
  }

  private home(): void {
    this.flown = this.session.run.distance_mm[0];
    if (this.isInside) this.lens(FOV_INSIDE);
    this.look = { yaw: 0, pitch: 0 };
    this.stand();
  }

  private maximise(): void {
    const wide = document.querySelector("#inspect")?.classList.toggle("wide");
    const button = this.root.querySelector<HTMLElement>(".corner button:last-child")!;
    button.textContent = wide ? "Restore" : "Maximise";
  }

  private explain(): void {
    this.within.setAttribute("aria-pressed", String(this.isInside));
    this.without.setAttribute("aria-pressed", String(!this.isInside));
    this.cut.disabled = this.isInside;
    this.raking.disabled = !this.isInside;
    this.canvas.title = this.hint.textContent = this.isInside ? "Wheel or W S flies, drag or A D looks around, a click moves the spot (ring)."
      : "Drag turns, wheel zooms, right drag shifts, a click moves the spot (ring).";
  }

  private async start(): Promise<void> {
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: !this.isPlain });
      if (this.isPlain) this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    } catch {
      this.told.textContent = "This browser shows no 3D (WebGL is off). Everything else works.";
      return;
    }
    this.renderer.localClippingEnabled = true;
    this.scene.background = new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim());
    this.scene.add(new THREE.AmbientLight(0xffffff, AMBIENT), this.lamp, this.marks.group, this.marker, this.line, this.corners);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("pointerdown", (e) => { this.pinch.down(e); this.pressed = { x: e.clientX, y: e.clientY }; });
    this.canvas.addEventListener("pointermove", (e) => this.turn(e));
    this.canvas.addEventListener("pointerup", (e) => { this.pinch.up(e); this.pick(e); });
    this.canvas.addEventListener("pointercancel", (e) => { this.pinch.up(e); this.pressed = null; });
    this.canvas.addEventListener("wheel", (e) => { if (this.isInside) { e.preventDefault(); this.fly(-e.deltaY / 20); } }, { passive: false });
    this.canvas.addEventListener("keydown", (e) => this.key(e));
    new ResizeObserver(() => this.resize()).observe(this.root);
    this.scene.add(this.fine.group, this.coarse.group);
    this.stand();
    try {
      await this.fine.start();
      if (!this.fine.isAll) void this.coarse.dress().catch((e: Error) => this.session.say(e.message));
      await this.fine.around(this.eye);
    } catch (error) {
      this.told.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  get parts() { return this.fine.parts; }
  get isReady(): boolean { return this.fine.isReady; }

  /** The distance next to which detail is wanted. */
  private get eye(): number { return this.isInside ? this.flown : this.session.cursor[0]; }

  /** A stretch has come or gone. */
  private grown(): void {
    this.coarse.hide(this.fine.span);
    if (!this.fine.isAll || this.fine.isReady) this.told.remove();
    this.draw();
  }

  private dress(): void {
    this.fine.dress();
    if (!this.fine.isAll) void this.coarse.dress().then(() => this.draw()).catch((e: Error) => this.session.say(e.message));
    this.draw();
  }

  private exaggerate(): void { this.fine.exaggerate(Number(this.gain.value)); this.draw(); }

  private stand(): void {
    if (!this.controls) return;
    this.controls.enabled = !this.isInside;
    const { radius_mm: radius, distance_mm: [from, to] } = this.session.run;
    if (this.isInside) {
      this.lens(FOV_INSIDE);
      this.fly(0);
      return;
    }
    const length = Math.min(to - from, OUTSIDE_RADII * radius);
    const middle = Math.min(Math.max(this.session.cursor[0], from + length / 2), to - length / 2);
    const centre = toModel(this.pipe.at(middle).origin).multiplyScalar(MM);
    this.lens(FOV_OUTSIDE);
    this.camera.up.set(0, 1, 0);
    const direction = new THREE.Vector3(0.85, 0.4, 0.35).normalize();
    this.camera.position.copy(centre).addScaledVector(direction, this.farOff(direction, centre, middle, length));
    this.controls.target.copy(centre);
    this.controls.update();
    this.draw();
  }

  /** How far off, in a direction, the eye must stand so that a stretch of pipe just fills the picture. */
  private farOff(direction: THREE.Vector3, centre: THREE.Vector3, middle: number, length: number): number {
    const right = new THREE.Vector3(0, 1, 0).cross(direction).normalize(), up = direction.clone().cross(right);
    const high = Math.tan((this.camera.fov * Math.PI) / 360), wide = high * this.camera.aspect;
    let far = 0;
    for (const s of [middle - length / 2, middle + length / 2]) {
      for (let a = 0; a < 6.28; a += 0.4) {
        const at = toModel(this.pipe.point(s, a, this.session.run.radius_mm)).multiplyScalar(MM).sub(centre);
        far = Math.max(far, at.dot(direction) + MARGIN * Math.max(Math.abs(at.dot(right)) / wide, Math.abs(at.dot(up)) / high));
      }
    }
    return far;
  }

  private lens(fov: number): void {
    this.camera.fov = fov;
    this.camera.updateProjectionMatrix();
  }

  private fly(mm: number): void {
    const [from, to] = this.session.run.distance_mm;
    const { radius_mm: radius } = this.session.run;
    this.flown = Math.max(Math.min(this.flown + mm, to - END_RADII * radius), from - END_RADII * radius);
    if (mm) this.lens(FOV_INSIDE);
    const { origin, x, y, tangent } = this.pipe.at(this.flown);
    const up = toModel(y).negate();
    const forward = toModel(tangent).applyAxisAngle(up, this.look.yaw).applyAxisAngle(toModel(x), this.look.pitch);
    this.camera.up.copy(up);
    this.camera.position.copy(toModel(origin).multiplyScalar(MM));
    this.camera.lookAt(this.camera.position.clone().add(forward));
    this.draw();
  }

  private follow(): void {
    const [distance, azimuth] = this.session.cursor;
    if (this.isInside && this.controls && !this.isStaying) this.turnTo(distance, azimuth);
    else if (!this.isInside && !this.fine.isAll) this.stand();
    const at = this.pipe.point(distance, azimuth, this.session.run.radius_mm * 0.995);
    this.marker.position.copy(toModel(at).multiplyScalar(MM));
    this.marker.lookAt(toModel(this.pipe.at(distance).origin).multiplyScalar(MM));
    this.marker.scale.setScalar(this.session.run.radius_mm * 0.06 * MM);
    this.draw();
  }

  /** Stand before a place of the wall, on the axis, and look at it, whatever its clock. */
  private turnTo(distance: number, azimuth: number): void {
    const { radius_mm: radius } = this.session.run;
    this.flown = distance - radius * BEFORE_RADII;
    this.lens(FOV_NEAR);
    this.fly(0); // at the start and the end of the wall the eye stays within it
    const [x, up, ahead] = [radius * Math.cos(azimuth), -radius * Math.sin(azimuth), distance - this.flown];
    this.look = { yaw: -Math.asin(x / Math.hypot(x, up, ahead)), pitch: Math.atan2(up, ahead) };
    this.fly(0);
  }

  /** What is being drawn or measured, on the wall. */
  private trace(): void {
    const { drawn, run } = this.session;
    const at = drawn.map(([s, a]) => toModel(this.pipe.point(s, a, run.radius_mm * 0.99)).multiplyScalar(MM));
    for (const shape of [this.line, this.corners]) {
      shape.geometry.dispose();
      shape.geometry = new THREE.BufferGeometry().setFromPoints(at);
      shape.renderOrder = 1;
      shape.frustumCulled = false;
    }
    this.draw();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 5 * FLIGHT_MM : FLIGHT_MM;
    const keys: Record<string, () => void> = {
      w: () => this.fly(step), s: () => this.fly(-step), ArrowUp: () => this.fly(step), ArrowDown: () => this.fly(-step),
      a: () => this.glance(0.08, 0), d: () => this.glance(-0.08, 0), ArrowLeft: () => this.glance(0.08, 0), ArrowRight: () => this.glance(-0.08, 0),
    };
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    if (!this.isInside) this.enter(true);
    act();
    event.preventDefault();
  }

  private glance(yaw: number, pitch: number): void {
    this.look = { yaw: this.look.yaw + yaw, pitch: Math.max(-1.3, Math.min(1.3, this.look.pitch + pitch)) };
    this.fly(0);
  }

  private turn(event: PointerEvent): void {
    if (!this.isInside) return;
    const { spread, dx, dy } = this.pinch.move(event);
    if (spread) this.fly(spread * 0.4);
    else if (event.buttons === 1) this.glance(dx * 0.004, dy * 0.004);
  }

  private pick(event: PointerEvent): void {
    const from = this.pressed;
    this.pressed = null;
    if (!from || Math.hypot(event.clientX - from.x, event.clientY - from.y) > 4) return;
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    const caster = new THREE.Raycaster();
    caster.setFromCamera(at, this.camera);
    const hit = caster.intersectObjects([...this.fine.meshes, ...this.coarse.group.children.filter((c) => c.visible)], false)
      .find((h) => !this.isCut || this.plane.distanceToPoint(h.point) >= 0);
    if (!hit) return;
    const { distance, azimuth } = this.pipe.coordinates(fromModel(hit.point));
    if (this.session.tool !== "none") {
      this.session.draw([distance, this.session.beside(azimuth)]);
      return;
    }
    this.isStaying = true; // a click looks, it does not travel
    this.session.moveTo([distance, azimuth]);
    this.isStaying = false;
  }

  private get isCut(): boolean { return this.cut.checked && !this.isInside; }

  private sharpen(share: number): void {
    const ratio = this.pixelRatio * share;
    if (Math.abs(this.renderer!.getPixelRatio() - ratio) > 0.02 * ratio) this.renderer!.setPixelRatio(ratio);
  }

  private get pixelRatio(): number {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    return Math.min(window.devicePixelRatio, Math.sqrt(MOST_PIXELS / (width * height)));
  }

  private resize(): void {
    const stage = this.canvas.parentElement!;
    const [width, height] = [stage.clientWidth, stage.clientHeight];
    if (!this.renderer || !width || !height) return;
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  private draw(): void {
    if (this.eye !== this.seen) {
      this.seen = this.eye;
      this.coarse.around(this.eye);
      void this.fine.around(this.eye).catch((e: Error) => this.session.say(e.message));
      this.marks.around(this.eye, this.isInside);
    }
    if (this.asked || !this.renderer) return;
    this.asked = true;
    requestAnimationFrame((now) => {
      this.asked = false;
      this.pace.step(now);
      this.frameTimes.push(now);
      if (this.frameTimes.length > 120) this.frameTimes.shift();
      this.shine();
      const across = new THREE.Vector3(this.camera.position.x, this.camera.position.y, 0);
      if (across.lengthSq() < 1e-12) across.set(1, 0, 0);
      this.plane.normal.copy(across.normalize().negate());
      const planes = this.isCut ? [this.plane] : [];
      this.fine.clip(planes);
      this.renderer!.render(this.scene, this.camera);
      const { clientWidth: width, clientHeight: height } = this.canvas;
      this.marks.follow(this.camera, width, height, this.session.cursor);
    });
  }

  /** Light along the wall from behind the eye, or over the shoulder of who looks from outside. */
  private shine(): void {
    this.lamp.intensity = this.isInside ? RAKING : SHINING;
    if (!this.isInside) { this.lamp.position.copy(this.camera.position).add(this.camera.up.clone().multiplyScalar(this.camera.position.length() / 2)); return; }
    const behind = this.flown - RAKING_RADII * this.session.run.radius_mm;
    const { origin, tangent } = this.pipe.at(this.flown);
    this.lamp.position.copy(toModel(origin).addScaledVector(toModel(tangent), behind - this.flown).multiplyScalar(MM));
  }
}
