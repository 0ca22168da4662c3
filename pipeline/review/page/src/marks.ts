/** Marks on the model: findings with their numbers, distances, clock positions, ends, a scale bar. */
import * as THREE from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { toModel } from "./graphics";
import type { Pipe } from "./pipe";
import { peakOf, type Session } from "./session";
import type { Finding, Point } from "./types";
import { CHOSEN_COLOUR, TURN, element } from "./words";

const MM = 1e-3;
// Findings and distances are marked within so many radii of the camera, from inside so many behind and ahead of it: those of
// a whole long pipe would be too many, and outlines are slow without a graphics card.
const NEAR_RADII = 14, [BEHIND_RADII, AHEAD_RADII] = [2, 8], RINGS_AHEAD_RADII = 7, CLOCK_RADII = 1.4;
const STEP_RAD = 0.06;
const [WITHIN, AROUND] = [0.985, 1.015]; // radii of marks, seen from inside and from outside
const BAR_PX: Point = [50, 150];
// From outside an outline lies this far in front of the wall, in radii: otherwise half its width would be hidden where the wall is seen obliquely.
const BEFORE_RADII = 0.15;
export const NEAR_M = 1e-3; // nothing nearer to the camera is drawn

interface Label { at: THREE.Vector3; root: HTMLElement; outward: THREE.Vector3 | null }

export class Marks {
  readonly layer = element("div", { class: "marks" });
  readonly group = new THREE.Group();
  private readonly findings = new THREE.Group();
  private readonly rings = new THREE.Group();
  private readonly bar = element("div", { class: "scale-bar" }, element("i"), element("span"));
  private readonly end = element("span", { class: "mark end" });
  private labels: Label[] = [];
  private casings: LineSegments2[] = [];
  private readonly scratch = { forward: new THREE.Vector3(), away: new THREE.Vector3(), seen: new THREE.Vector3() }; // used in every picture
  private at = NaN;
  private isInside = true;

  constructor(private readonly session: Session, private readonly pipe: Pipe) {
    this.group.add(this.findings, this.rings);
    this.layer.append(this.bar);
  }

  /** Redraw the marks near a distance; only if the camera has moved far, unless `anew`. */
  around(distance: number, isInside: boolean, anew = false): void {
    const moved = Math.abs(distance - this.at) > this.session.run.radius_mm / 2;
    if (!anew && !moved && isInside === this.isInside) return;
    this.at = distance;
    this.isInside = isInside;
    for (const label of this.labels) label.root.remove();
    this.labels = [];
    for (const group of [this.findings, this.rings]) clear(group);
    this.casings = [];
    const { radius_mm: radius } = this.session.run;
    const [first, last] = [distance - (isInside ? BEHIND_RADII : NEAR_RADII) * radius, distance + (isInside ? AHEAD_RADII : NEAR_RADII) * radius];
    const seen = this.session.standing.filter((f) => f.size.distance_to_mm > first && f.size.distance_from_mm < last);
    const isChosen = (f: Finding) => f.id === this.session.selected;
    this.outlines(seen.filter((f) => !isChosen(f)), "#ffffff", 1.8, 4);
    this.outlines(seen.filter(isChosen), CHOSEN_COLOUR, 3, 5.5);
    for (const finding of seen) this.name(finding, isChosen(finding));
    this.distances();
    this.clock();
    const end = this.session.run.distance_mm[1];
    this.end.textContent = `end of the measured wall, ${end.toFixed(0)} mm`;
    if (isInside) this.put(this.place(end, 0, 0), this.end, null);
  }

  /** Move the labels to where their places are seen. */
  follow(camera: THREE.PerspectiveCamera, width: number, height: number, spot: Point): void {
    const { forward, away, seen } = this.scratch;
    camera.getWorldDirection(forward);
    for (const { at, root, outward } of this.labels) {
      away.copy(at).sub(camera.position);
      seen.copy(at).project(camera);
      const isHidden = away.dot(forward) <= 0 || Math.abs(seen.x) > 1 || Math.abs(seen.y) > 1
        || (this.isInside ? away.length() > NEAR_RADII * this.session.run.radius_mm * MM : outward !== null && outward.dot(away) > 0);
      if (root.hidden !== isHidden) root.hidden = isHidden;
      if (!isHidden) root.style.transform = `translate(${(((seen.x + 1) / 2) * width).toFixed(0)}px, ${(((1 - seen.y) / 2) * height).toFixed(0)}px)`;
    }
    this.measure(camera, height, forward, spot);
  }

  /** The length of the bar matches its number at the chosen place, or at the target seen from outside. */
  private measure(camera: THREE.PerspectiveCamera, height: number, forward: THREE.Vector3, spot: Point): void {
    const far = this.place(spot[0], spot[1], this.isInside ? 1 : 0).sub(camera.position).dot(forward);
    const pxPerMm = (height / 2 / Math.tan((camera.fov * Math.PI) / 360) / far) * MM;
    const mm = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].find((n) => n * pxPerMm >= BAR_PX[0]) ?? 0;
    this.bar.hidden = !(far > 0) || !mm || mm * pxPerMm > 2 * BAR_PX[1];
    (this.bar.firstChild as HTMLElement).style.width = `${(mm * pxPerMm).toFixed(0)}px`;
    this.bar.lastChild!.textContent = `${mm} mm ${this.isInside ? "at the spot" : "at the axis"}`;
  }

  /** While the view moves and would stutter, draw without the border of outlines, which is as slow as the outlines. */
  thin(isThin: boolean): void { for (const casing of this.casings) casing.visible = !isThin; }

  /** All outlines of one colour as one line, since each line is a separate drawing call. */
  private outlines(findings: Finding[], colour: string, width: number, casing: number): void {
    const place = findings.flatMap((f) => this.segments(f.outline, this.isInside ? WITHIN : AROUND));
    if (!place.length) return;
    const geometry = new LineSegmentsGeometry().setPositions(place);
    const [below, above] = ([["#000000", casing], [colour, width]] as [string, number][]).map(([color, linewidth], k) => {
      const material = new LineMaterial({ color, linewidth, depthTest: !this.isInside, depthWrite: false, transparent: true });
      // The depth buffer varies as 1 / distance: this much less of it is BEFORE_RADII nearer.
      const nearer = 2 * NEAR_M * BEFORE_RADII * this.session.run.radius_mm * MM;
      material.vertexShader = material.vertexShader.replace("#include <logdepthbuf_vertex>", `gl_Position.z -= ${nearer.toExponential()} / gl_Position.w;\n#include <logdepthbuf_vertex>`);
      const line = new LineSegments2(geometry, material);
      line.renderOrder = 2 + k;
      return line;
    }) as [LineSegments2, LineSegments2];
    this.casings.push(below);
    this.findings.add(below, above);
  }

  private name(finding: Finding, chosen: boolean): void {
    const [s, a] = peakOf(finding);
    const name = element("button", {
      class: `mark finding${chosen ? " chosen" : ""}`, tabindex: "-1", "data-finding": finding.id, title: `${finding.label}: ${finding.kind}`,
      click: () => this.session.select(finding.id),
    }, finding.label.split(" ")[0]!);
    const from = Math.max(...finding.outline.map((p) => p[0]));
    this.put(this.place(Math.max(s, from), a, this.isInside ? WITHIN : AROUND), name, this.outward(s, a));
  }

  private segments(outline: Point[], radii: number): number[] {
    const out: number[] = [];
    outline.forEach(([s, a], k) => {
      const [s1, a1] = outline[(k + 1) % outline.length]!;
      const parts = Math.max(1, Math.ceil(Math.abs(a1 - a) / STEP_RAD));
      for (let n = 0; n < parts; n++) {
        for (const t of [n / parts, (n + 1) / parts]) out.push(...this.place(s + t * (s1 - s), a + t * (a1 - a), radii).toArray());
      }
    });
    return out;
  }

  /** Thin rings at round distances, with their number at half past one. */
  private distances(): void {
    const { distance_mm: [from, to], radius_mm: radius } = this.session.run;
    const step = [5, 10, 20, 50, 100, 200, 500, 1000].find((n) => n >= 0.9 * radius) ?? 2000;
    const [first, last] = this.isInside ? [this.at + 0.6 * radius, this.at + RINGS_AHEAD_RADII * radius] : [this.at - NEAR_RADII * radius, this.at + NEAR_RADII * radius];
    for (let s = Math.ceil(Math.max(first, from) / step) * step; s <= Math.min(last, to); s += step) {
      const points = Array.from({ length: 65 }, (_, k) => this.place(s, (k / 64) * TURN, this.isInside ? 0.99 : AROUND));
      const line = new THREE.Line(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.45 }));
      line.renderOrder = 1;
      this.rings.add(line);
      const a = this.isInside ? -Math.PI / 4 : -Math.PI / 2;
      this.put(this.place(s, a, this.isInside ? 0.95 : 1.08), element("span", { class: "mark" }, `${s} mm`), null);
    }
  }

  private clock(): void {
    const { distance_mm: [from, to], radius_mm: radius } = this.session.run;
    const where = this.isInside ? [Math.min(this.at + CLOCK_RADII * radius, to)] : [Math.max(from, this.at - NEAR_RADII * radius)];
    for (const s of where) {
      for (const hour of [12, 3, 6, 9]) {
        const a = ((hour - 3) * Math.PI) / 6;
        this.put(this.place(s, a, this.isInside ? 0.8 : 1.12), element("span", { class: "mark hour" }, String(hour)), null);
      }
    }
  }

  private put(at: THREE.Vector3, root: HTMLElement, outward: THREE.Vector3 | null): void {
    root.hidden = true;
    this.labels.push({ at, root, outward });
    this.layer.append(root);
  }

  /** A place in the model, its distance from the axis in radii. */
  private place(distance: number, azimuth: number, radii: number): THREE.Vector3 {
    return toModel(this.pipe.point(distance, azimuth, radii * this.session.run.radius_mm)).multiplyScalar(MM);
  }

  private outward(distance: number, azimuth: number): THREE.Vector3 {
    return this.place(distance, azimuth, 1).sub(this.place(distance, azimuth, 0)).normalize();
  }
}

function clear(group: THREE.Group): void {
  for (const child of group.children) {
    const { geometry, material } = child as THREE.Mesh;
    geometry.dispose();
    (material as THREE.Material).dispose();
  }
  group.clear();
}
