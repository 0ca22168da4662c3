/** The 3D model: every material variant, exaggerated relief, cut open, seen from outside or in flight. */
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { CoarseWall } from "./coarse";
import { Eye } from "./eye";
import { Pace, drawsPlainly, fromModel, toModel } from "./graphics";
import { hold } from "./hands";
import { Lamp } from "./lamp";
import { layerChoice, legend } from "./legend";
import { Marks } from "./marks";
import { Pipe } from "./pipe";
import type { Session } from "./session";
import { Spot } from "./spot";
import { Stretches, type Light } from "./stretches";
import { element } from "./words";

const [MM, MOST_PIXELS] = [1e-3, 1280 * 720];
// Position of the raking light behind the camera, in radii: it meets the wall beside the chosen place at about 12°, so that a slope of
// 0.1 changes its brightness by a third. Strengths make a flat wall there as bright as recorded.
const RAKING_RADII = 3.5;
const [AMBIENT, RAKING, SHINING] = [0.35 * Math.PI, 9.7, 0.6 * Math.PI];
export class ModelView {
  private readonly isPlain = drawsPlainly(); // must come first: it defines how colours are interpreted
  readonly root = element("div", { class: "model" });
  readonly frameTimes: number[] = [];
  private readonly canvas = element("canvas", { tabindex: "0", role: "img", "aria-label": "Model of the pipe. Inside: W and S fly along it, A and D turn the view." });
  private readonly told = element("p", { class: "veil" }, "Loading the model…");
  private readonly gain = element("input", { type: "range", min: "1", max: "20", value: "1", id: "gain" });
  private readonly gained = element("output", { for: "gain" }, "1×");
  private readonly cut = element("input", { type: "checkbox", id: "cut" });
  private readonly within = element("button", { "aria-pressed": "true", click: () => this.enter(true) }, "Inside");
  private readonly without = element("button", { "aria-pressed": "false", click: () => this.enter(false) }, "Outside");
  private readonly hint = element("p", { class: "hint view-hint" });
  private readonly raking = element("input", { type: "checkbox", id: "raking" });
  private readonly pace = new Pace((sharpness, isMoving) => this.sharpen(sharpness, isMoving), () => this.draw());
  private readonly pipe: Pipe;
  private readonly scene = new THREE.Scene();
  private readonly ground = new THREE.Color();
  private readonly beyond = new THREE.Color(0x46525e); // colour of the background seen from inside: beyond the ends, and where nothing was measured
  private readonly eye: Eye;
  private readonly rake = new THREE.PointLight(0xffffff, RAKING, 0, 0);
  private readonly marks: Marks;
  private isStaying = false;
  private readonly spot: Spot;
  private readonly lamp: Lamp;
  private readonly plane = new THREE.Plane(new THREE.Vector3(1, 0, 0), 0);
  private renderer: THREE.WebGLRenderer | null = null;
  private controls: OrbitControls | null = null;
  private readonly fine: Stretches;
  private readonly coarse: CoarseWall;
  private asked = false;
  private show!: () => void;
  /** Resolved once a part of the model is visible, or none will be: whatever the first view does not need waits for it. */
  readonly first = new Promise<void>((resolve) => { this.show = resolve; });
  private seen = NaN; // position of the camera at the last request for stretches

  constructor(private readonly session: Session) {
    this.pipe = new Pipe(session.run.axis);
    this.eye = new Eye(session, this.pipe);
    this.spot = new Spot(session, this.pipe);
    this.lamp = new Lamp(this.isPlain);
    this.fine = new Stretches(session, this.pipe, this.lamp, this.isPlain, () => this.grown());
    this.coarse = new CoarseWall(session, this.pipe, this.isPlain, () => this.draw());
    this.marks = new Marks(session, this.pipe);
    const button = (name: string, title: string, click: () => void) => element("button", { title, click }, name);
    this.root.append(element("div", { class: "stage" }, this.canvas, this.marks.layer, this.told,
      element("div", { class: "over corner" }, button("Fit", "turn to the spot or the chosen finding", () => this.follow()),
        button("Home", "back to the start of the pipe", () => this.home()), button("Maximise", "the model alone, and back", () => this.maximise())),
      this.manner(), element("div", { class: "over foot" }, legend(session), this.hint)));
    this.explain();
    session.on(["layer", "limits"], () => this.dress());
    session.on(["state", "selection"], () => { this.marks.around(this.eye.distance, this.eye.isInside, true); this.draw(); });
    session.on(["cursor"], () => this.follow());
    session.on(["stand"], () => this.standAs());
    session.on(["shape"], () => { this.spot.trace(); this.draw(); });
    void this.start();
  }

  /** The controls beside the pane's title. */
  bar(): HTMLElement {
    return element("div", { class: "bar" },
      element("span", { class: "joined", role: "group", "aria-label": "where the model is seen from" }, this.within, this.without),
      element("label", {}, "shows ", layerChoice(this.session, "what the model shows")));
  }

  /** How the model is shown; the controls are in the picture, where there is room. */
  private manner(): HTMLElement {
    this.gain.addEventListener("input", () => { this.gained.textContent = `${this.gain.value}×`; this.exaggerate(); });
    this.cut.addEventListener("change", () => this.draw());
    this.raking.addEventListener("change", () => { this.fine.dress(this.light); this.draw(); });
    return element("div", { class: "over manner" },
      element("label", { for: "raking", title: "light along the wall: dents and pits throw shadows" }, this.raking, " raking light"),
      element("label", { for: "cut", title: "take away the half toward the viewer" }, this.cut, " cut open"),
      element("label", { for: "gain", title: "exaggerate how far the wall leaves the round pipe" }, "relief ", this.gain, " ", this.gained));
  }

  private get light(): Light {
    if (this.session.stand) return "frame";
    return this.raking.checked || !this.eye.isInside ? "raking" : "even";
  }

  private enter(inside: boolean): void {
    this.leave();
    this.eye.isInside = inside;
    this.fine.dress(this.light);
    this.stand();
    this.explain();
  }

  private home(): void {
    this.leave();
    this.eye.home();
    this.stand();
  }

  /** The size of the picture in CSS pixels. */
  get size(): [number, number] { return [this.canvas.clientWidth, this.canvas.clientHeight]; }

  /** Go to the camera of the frame that the session names, with its light; with uniform light where it names none. */
  private standAs(): void {
    const { stand } = this.session;
    if (stand) {
      this.lamp.take(stand);
      this.eye.standAs(stand);
      if (this.controls) this.controls.enabled = false;
    }
    this.explain();
    this.fine.dress(this.light);
    this.draw();
  }

  /** Leave the camera of a frame, since the view was moved by hand. */
  private leave(): void { this.session.standAs(null); }

  private maximise(): void {
    const wide = document.querySelector("#inspect")?.classList.toggle("wide");
    const button = this.root.querySelector<HTMLElement>(".corner button:last-child")!;
    button.textContent = wide ? "Restore" : "Maximise";
  }

  private explain(): void {
    this.within.setAttribute("aria-pressed", String(this.eye.isInside));
    this.without.setAttribute("aria-pressed", String(!this.eye.isInside));
    this.cut.disabled = this.eye.isInside;
    this.raking.disabled = !this.eye.isInside || this.session.stand !== null;
    this.canvas.title = this.hint.textContent = this.eye.isInside ? "Fly: wheel or W S. Look around: drag or A D. A click moves the spot (ring)."
      : "Turn: drag. Zoom: wheel. Shift: right drag. A click moves the spot (ring).";
  }

  private async start(): Promise<void> {
    const listed = this.fine.start();
    listed.catch(() => undefined); // reported below, where it is awaited
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: !this.isPlain });
      if (this.isPlain) this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    } catch {
      this.told.textContent = "This browser shows no 3D (WebGL is off). Everything else works.";
      this.root.classList.add("blank");
      this.show();
      return;
    }
    this.renderer.localClippingEnabled = true;
    this.ground.set(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim());
    this.scene.add(new THREE.AmbientLight(0xffffff, AMBIENT), this.rake, this.marks.group, this.spot.group);
    this.controls = new OrbitControls(this.eye.camera, this.canvas);
    this.controls.addEventListener("change", () => this.draw());
    hold(this.canvas, {
      isInside: () => this.eye.isInside, enter: () => this.enter(true), fly: (mm) => this.fly(mm),
      glance: (yaw, pitch) => this.glance(yaw, pitch), pick: (x, y) => this.pick(x, y),
    });
    new ResizeObserver(() => this.resize()).observe(this.root);
    this.scene.add(this.fine.group, this.coarse.group);
    this.stand();
    try {
      await listed;
      if (!this.fine.isAll) void this.coarse.dress().catch((e: Error) => this.session.say(e.message));
      await this.fine.around(this.eye.distance);
    } catch (error) {
      this.told.textContent = error instanceof Error ? error.message : String(error);
      this.show();
    }
  }

  get parts() { return this.fine.parts; }
  get isReady() { return this.fine.isReady; }

  /** Called when a stretch was loaded or removed. */
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
    this.controls.enabled = !this.eye.isInside;
    const centre = this.eye.stand();
    if (centre) {
      this.controls.target.copy(centre);
      this.controls.update();
    }
    this.draw();
  }

  private fly(mm: number): void {
    this.leave();
    this.eye.fly(mm);
    this.draw();
  }

  private glance(yaw: number, pitch: number): void {
    this.leave();
    this.eye.glance(yaw, pitch);
    this.draw();
  }

  private follow(): void {
    const [distance, azimuth] = this.session.cursor;
    if (this.eye.isInside && this.controls && !this.isStaying && !this.session.stand) this.eye.turnTo(distance, azimuth);
    else if (!this.eye.isInside && !this.isStaying) this.stand();
    this.spot.follow();
    this.draw();
  }

  /** Choose the place of the wall under a point of the picture, both coordinates from -1 to 1. */
  private pick(x: number, y: number): void {
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(x, y), this.eye.camera);
    const hit = caster.intersectObjects([...this.fine.meshes, ...this.coarse.group.children.filter((c) => c.visible)], false)
      .find((h) => !this.isCut || this.plane.distanceToPoint(h.point) >= 0);
    if (!hit) return;
    const { distance, azimuth } = this.pipe.coordinates(fromModel(hit.point));
    if (this.session.tool !== "none") {
      this.session.draw([distance, this.session.beside(azimuth)]);
      return;
    }
    this.isStaying = true; // a click turns the view without moving the camera
    this.session.moveTo([distance, azimuth]);
    this.isStaying = false;
  }

  private get isCut(): boolean { return this.cut.checked && !this.eye.isInside; }

  private sharpen(share: number, isMoving: boolean): void {
    this.fine.thin(isMoving);
    this.marks.thin(isMoving && this.isPlain);
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
    this.eye.shape(width / height);
    this.draw();
  }

  private draw(): void {
    const { camera, distance } = this.eye;
    if (distance !== this.seen) {
      this.seen = distance;
      this.coarse.around(distance);
      void this.fine.around(distance).catch((e: Error) => this.session.say(e.message));
      this.marks.around(distance, this.eye.isInside);
    }
    if (this.asked || !this.renderer) return;
    this.asked = true;
    this.pace.ask(performance.now());
    requestAnimationFrame((now) => {
      this.asked = false;
      this.pace.step(now);
      this.frameTimes.push(now);
      if (this.frameTimes.length > 120) this.frameTimes.shift();
      this.shine();
      this.scene.background = this.eye.isInside ? this.beyond : this.ground;
      const across = new THREE.Vector3(camera.position.x, camera.position.y, 0);
      if (across.lengthSq() < 1e-12) across.set(1, 0, 0);
      this.plane.normal.copy(across.normalize().negate());
      const planes = this.isCut ? [this.plane] : [];
      this.fine.clip(planes);
      this.renderer!.render(this.scene, camera);
      if (this.parts.length) this.show();
      this.marks.follow(camera, ...this.size, this.session.cursor);
    });
  }

  /** Light along the wall from behind the camera, or from beside the viewer outside. */
  private shine(): void {
    const { camera, isInside, flown } = this.eye;
    this.rake.intensity = isInside ? RAKING : SHINING;
    if (!isInside) { this.rake.position.copy(camera.position).add(camera.up.clone().multiplyScalar(camera.position.length() / 2)); return; }
    const { origin, tangent } = this.pipe.at(flown);
    this.rake.position.copy(toModel(origin).addScaledVector(toModel(tangent), -RAKING_RADII * this.session.run.radius_mm).multiplyScalar(MM));
  }
}
