/** Properties of the machine and of glTF that drawing depends on. */
import * as THREE from "three";
import type { Vector } from "./pipe";

const MM = 1e-3;
// 60 pictures a second while moving; after a longer gap the view rests, and the picture is drawn sharply.
const [WANTED_STEP_MS, LONGEST_STEP_MS, REST_MS, LEAST_SHARPNESS] = [17, 250, 300, 0.4];

/** Draws less sharply while the view moves, where it would stutter otherwise, and sharply again at rest. */
export class Pace {
  private sharpness = 1;
  private drawnAt = -Infinity;
  private askedAt = 0;
  private resting = 0;

  /** `sharpen` takes the share of the pixels in each direction and whether the view moves. */
  constructor(private readonly sharpen: (sharpness: number, isMoving: boolean) => void, private readonly draw: () => void) {}

  /** Request a picture. */
  ask(now: number): void { this.askedAt = now; }

  /** Called before a picture is drawn. The view counts as moving if the picture was requested soon after the last one, however long that took. */
  step(now: number): void {
    const took = now - this.drawnAt, isMoving = this.askedAt - this.drawnAt < LONGEST_STEP_MS;
    this.drawnAt = now;
    if (isMoving && took > 1.5 * WANTED_STEP_MS) this.sharpness = Math.max(LEAST_SHARPNESS, this.sharpness * Math.min(0.85, Math.max(0.5, Math.sqrt(WANTED_STEP_MS / took))));
    if (isMoving && took < 1.1 * WANTED_STEP_MS) this.sharpness = Math.min(1, this.sharpness * 1.02);
    window.clearTimeout(this.resting);
    if (!isMoving) return;
    this.sharpen(this.sharpness, true);
    this.resting = window.setTimeout(() => { this.sharpen(1, false); this.drawnAt = -Infinity; this.draw(); }, REST_MS);
  }
}

/** The model's axes are those of glTF: x right, y up, z toward the viewer; the pipe's are x right, y down, z forward. */
export function toModel([x, y, z]: Vector): THREE.Vector3 { return new THREE.Vector3(x, -y, -z); }
export function fromModel(v: THREE.Vector3): Vector { return [v.x / MM, -v.y / MM, -v.z / MM]; }

/** Whether the processor draws the pictures; then colours are not converted, and edges not smoothed. */
export function drawsPlainly(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const named = context?.getExtension("WEBGL_debug_renderer_info");
  const name = named ? String(context!.getParameter(named.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  const isSlow = /swiftshader|llvmpipe|software|basic render/i.test(name);
  THREE.ColorManagement.enabled = !isSlow;
  return isSlow;
}

/** Touches or pens on a view: how far the last one moved, and by how much the distance of two changed. */
export class Pinch {
  private readonly at = new Map<number, { x: number; y: number }>();

  down(event: PointerEvent): void { this.at.set(event.pointerId, { x: event.clientX, y: event.clientY }); }
  up(event: PointerEvent): void { this.at.delete(event.pointerId); }

  get isTwo(): boolean { return this.at.size > 1; }

  move(event: PointerEvent): { spread: number; dx: number; dy: number } {
    const before = this.at.get(event.pointerId);
    if (!before) return { spread: 0, dx: 0, dy: 0 };
    const apart = this.apart();
    this.down(event);
    return { spread: this.isTwo ? this.apart() - apart : 0, dx: event.clientX - before.x, dy: event.clientY - before.y };
  }

  private apart(): number {
    const [a, b] = [...this.at.values()];
    return a && b ? Math.hypot(a.x - b.x, a.y - b.y) : 0;
  }
}
