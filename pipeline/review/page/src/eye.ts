/** The camera of the model's view: in flight along the pipe, at the camera of a recorded frame, or outside. */
import * as THREE from "three";
import { toModel } from "./graphics";
import { NEAR_M } from "./marks";
import type { Pipe } from "./pipe";
import type { Session } from "./session";
import type { Stand } from "./types";

const MM = 1e-3;
// From outside, at most this many radii of a long pipe are shown: all of it would be a thin thread.
const OUTSIDE_RADII = 16;
// Distance of the camera from the chosen place, in radii.
const BEFORE_RADII = 1.1;
// How far the camera may go before the start of the wall, and how near to its end, in radii.
const END_RADII = 0.3;
const [FOV_INSIDE, FOV_NEAR, FOV_OUTSIDE] = [80, 52, 30];
export const FOV_STAND = 44;
const MARGIN = 1.12;
// From outside, the camera looks at the chosen place obliquely, by so much along the pipe: depth stays visible, and up stays up at 12 and 6 o'clock.
const ASIDE = 0.5;
const MOST_PITCH_RAD = 1.3;

export class Eye {
  readonly camera = new THREE.PerspectiveCamera(FOV_INSIDE, 1, NEAR_M, 1000);
  isInside = true;
  flown: number;
  private look = { yaw: 0, pitch: 0 };

  constructor(private readonly session: Session, private readonly pipe: Pipe) { this.flown = session.run.distance_mm[0]; }

  /** The distance near which detail is needed. */
  get distance(): number { return this.isInside ? this.flown : this.session.cursor[0]; }

  /** Back to the start of the pipe. */
  home(): void {
    this.flown = this.session.run.distance_mm[0];
    this.look = { yaw: 0, pitch: 0 };
  }

  fly(mm: number): void {
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
  }

  /** Go to the axis near a place of the wall and look at it, at any clock position. */
  turnTo(distance: number, azimuth: number): void {
    const { radius_mm: radius } = this.session.run;
    this.flown = distance - radius * BEFORE_RADII;
    this.lens(FOV_NEAR);
    this.fly(0); // at the start and the end of the wall the camera stays within it
    const [x, up, ahead] = [radius * Math.cos(azimuth), -radius * Math.sin(azimuth), distance - this.flown];
    this.look = { yaw: -Math.asin(x / Math.hypot(x, up, ahead)), pitch: Math.atan2(up, ahead) };
    this.fly(0);
  }

  glance(yaw: number, pitch: number): void {
    this.look = { yaw: this.look.yaw + yaw, pitch: Math.max(-MOST_PITCH_RAD, Math.min(MOST_PITCH_RAD, this.look.pitch + pitch)) };
    this.fly(0);
  }

  /** Go to the camera of a recorded frame, turned to the chosen place. */
  standAs({ eye_p, target_p, up_p }: Stand): void {
    this.isInside = true;
    this.flown = this.pipe.coordinates(eye_p).distance;
    this.lens(FOV_STAND);
    this.camera.up.copy(toModel(up_p));
    this.camera.position.copy(toModel(eye_p).multiplyScalar(MM));
    this.camera.lookAt(toModel(target_p).multiplyScalar(MM));
  }

  /** Go inside, to the last distance; or outside, on the side of the chosen place, so that the pipe fills the picture. Returns the target there. */
  stand(): THREE.Vector3 | null {
    if (this.isInside) {
      this.lens(FOV_INSIDE);
      this.fly(0);
      return null;
    }
    const { radius_mm: radius, distance_mm: [from, to] } = this.session.run;
    const length = Math.min(to - from, OUTSIDE_RADII * radius);
    const middle = Math.min(Math.max(this.session.cursor[0], from + length / 2), to - length / 2);
    const centre = toModel(this.pipe.at(middle).origin).multiplyScalar(MM);
    this.lens(FOV_OUTSIDE);
    this.camera.up.set(0, 1, 0);
    const { x, y, tangent } = this.pipe.at(this.session.cursor[0]), a = this.session.cursor[1];
    const direction = toModel(x).multiplyScalar(Math.cos(a)).addScaledVector(toModel(y), Math.sin(a)).addScaledVector(toModel(tangent), -ASIDE).normalize();
    this.camera.position.copy(centre).addScaledVector(direction, this.farOff(direction, centre, middle, length));
    return centre;
  }

  shape(aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
  }

  /** The distance, in a direction, from which a stretch of pipe just fills the picture. */
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
}
