/** Pipe that is too far away for detail: a round tube textured with the small tiles of the flat view. */
import * as THREE from "three";
import type { Pipe } from "./pipe";
import type { Session } from "./session";
import type { Layer } from "./types";
import { TURN } from "./words";

const MM = 1e-3;
const TILE = 512;
const AROUND = 24;
const LEAST_ROWS = 40; // pixels of a tile around the pipe
const SEEN_RADII = 80;
const WIDER = 1.004; // so that the detailed wall lies in front where both exist

interface Piece { mesh: THREE.Mesh<THREE.BufferGeometry, THREE.Material[]>; from: number; to: number; rings: number; address: string; isDressed: boolean }

export class CoarseWall {
  readonly group = new THREE.Group();
  private pieces: Piece[] = [];
  private hidden: [number, number] | null = null;
  private at = 0;

  constructor(private readonly session: Session, private readonly pipe: Pipe, private readonly isPlain: boolean, private readonly changed: () => void) {}

  async dress(): Promise<void> {
    const name = this.session.layer;
    const layer = await this.session.source.layer(name);
    if (name !== this.session.layer) return;
    this.clear();
    const level = Math.max(0, Math.min(layer.levels - 1, Math.floor(Math.log2(layer.height / LEAST_ROWS))));
    const span = TILE << level;
    for (let column = 0; column * span < layer.width; column++) this.pieces.push(this.piece(name, layer, level, column));
    this.group.add(...this.pieces.map((p) => p.mesh));
    this.around(this.at);
    this.hide(this.hidden);
  }

  /** Show the parts that are visible from a distance. */
  around(distance: number): void {
    this.at = distance;
    const reach = SEEN_RADII * this.session.run.radius_mm;
    for (const piece of this.pieces) {
      piece.mesh.visible = piece.to > distance - reach && piece.from < distance + reach;
      if (piece.mesh.visible && !piece.isDressed) this.load(piece);
    }
  }

  /** Leave out the distances covered by the detailed model. */
  hide(between: [number, number] | null): void {
    this.hidden = between;
    const [from, to] = between ?? [Infinity, Infinity];
    for (const { mesh, from: first, to: last, rings } of this.pieces) {
      const ring = (mm: number) => (rings * (mm - first)) / (last - first);
      const inside = (n: number) => Math.max(0, Math.min(rings, n)) * AROUND * 6;
      // One more ring on either side, so that there is no gap at the joint.
      const [a, b] = [inside(Math.ceil(ring(from)) + 1), inside(Math.floor(ring(to)) - 1)];
      if (a >= b) { mesh.geometry.clearGroups(); mesh.geometry.addGroup(0, rings * AROUND * 6, 0); continue; }
      mesh.geometry.clearGroups();
      if (a > 0) mesh.geometry.addGroup(0, a, 0);
      if (b < rings * AROUND * 6) mesh.geometry.addGroup(b, rings * AROUND * 6 - b, 0);
    }
  }

  private piece(name: string, layer: Layer, level: number, column: number): Piece {
    const perPx = (layer.distance_mm[1] - layer.distance_mm[0]) / layer.width;
    const at = (px: number) => layer.distance_mm[0] + Math.min(px, layer.width) * perPx;
    const [from, to] = [at(column * (TILE << level)), at((column + 1) * (TILE << level))];
    const rings = Math.max(1, Math.ceil((to - from) / (this.session.run.radius_mm / 2)));
    const plain = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide });
    plain.color.set(0x808080);
    const mesh = new THREE.Mesh(this.tube(from, to, rings, layer.azimuth_rad), [plain]);
    return { mesh, from, to, rings, address: this.session.source.tile(name, level, column, 0, this.session.limits(name)), isDressed: false };
  }

  private tube(from: number, to: number, rings: number, azimuth: number): THREE.BufferGeometry {
    const place: number[] = [], uv: number[] = [], index: number[] = [];
    for (let i = 0; i <= rings; i++) {
      for (let j = 0; j <= AROUND; j++) {
        const [x, y, z] = this.pipe.point(from + ((to - from) * i) / rings, azimuth + (TURN * j) / AROUND, this.session.run.radius_mm * WIDER);
        place.push(x * MM, -y * MM, -z * MM);
        uv.push(i / rings, 1 - j / AROUND);
      }
    }
    for (let i = 0; i < rings; i++) {
      for (let j = 0; j < AROUND; j++) {
        const a = i * (AROUND + 1) + j, b = a + AROUND + 1;
        index.push(a, b, a + 1, a + 1, b, b + 1);
      }
    }
    const made = new THREE.BufferGeometry();
    made.setAttribute("position", new THREE.Float32BufferAttribute(place, 3));
    made.setAttribute("uv", new THREE.Float32BufferAttribute(uv, 2));
    made.setIndex(index);
    made.computeVertexNormals();
    return made;
  }

  private load(piece: Piece): void {
    piece.isDressed = true;
    if (this.session.source.readOnly) return; // a page from a file may not hand its pictures to WebGL
    const image = new Image();
    image.onload = () => {
      const material = piece.mesh.material[0] as THREE.MeshBasicMaterial;
      material.map = new THREE.Texture(image);
      material.map.colorSpace = this.isPlain ? THREE.NoColorSpace : THREE.SRGBColorSpace;
      material.map.needsUpdate = true;
      material.color.set(0xffffff);
      material.needsUpdate = true;
      this.changed();
    };
    image.src = piece.address;
  }

  private clear(): void {
    for (const { mesh } of this.pieces) {
      mesh.geometry.dispose();
      (mesh.material[0] as THREE.MeshBasicMaterial).map?.dispose();
      mesh.material[0]!.dispose();
    }
    this.group.clear();
    this.pieces = [];
  }
}
