/** The chosen place, and shapes being drawn or measured, on the model's wall. */
import * as THREE from "three";
import { toModel } from "./graphics";
import type { Pipe } from "./pipe";
import type { Session } from "./session";
import { CHOSEN_COLOUR } from "./words";

const MM = 1e-3;
const SEEN_THROUGH = { color: CHOSEN_COLOUR, depthTest: false, transparent: true };

export class Spot {
  readonly group = new THREE.Group();
  readonly marker = new THREE.Mesh(new THREE.TorusGeometry(1, 0.14, 8, 32), new THREE.MeshBasicMaterial(SEEN_THROUGH));
  private readonly line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial(SEEN_THROUGH));
  private readonly corners = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ ...SEEN_THROUGH, size: 9, sizeAttenuation: false }));

  constructor(private readonly session: Session, private readonly pipe: Pipe) {
    this.group.add(this.marker, this.line, this.corners);
    for (const part of [this.marker, this.line, this.corners]) part.renderOrder = 1; // drawn after the wall, which would cover them otherwise
    for (const part of [this.line, this.corners]) part.frustumCulled = false;
  }

  /** Move the ring to the chosen place. */
  follow(): void {
    const { cursor: [distance, azimuth], run } = this.session;
    this.marker.position.copy(toModel(this.pipe.point(distance, azimuth, run.radius_mm * 0.995)).multiplyScalar(MM));
    this.marker.lookAt(toModel(this.pipe.at(distance).origin).multiplyScalar(MM));
    this.marker.scale.setScalar(run.radius_mm * 0.035 * MM);
  }

  /** Show the shape that is being drawn or measured. */
  trace(): void {
    const { drawn, run } = this.session;
    const at = drawn.map(([s, a]) => toModel(this.pipe.point(s, a, run.radius_mm * 0.99)).multiplyScalar(MM));
    for (const shape of [this.line, this.corners]) {
      shape.geometry.dispose();
      shape.geometry = new THREE.BufferGeometry().setFromPoints(at);
    }
  }
}
