/** The pipe's own coordinates: distance and azimuth about its axis, to and from points in space (mm). */
import type { Axis } from "./types";

export type Vector = [number, number, number];

const add = (a: Vector, b: Vector, t: number): Vector => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const less = (a: Vector, b: Vector): Vector => add(a, b, -1);
const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export class Pipe {
  constructor(private readonly axis: Axis) {}

  private get steps(): number { return this.axis.distance_mm.length; }

  /** Origin, section directions and tangent at a distance. */
  at(distance: number): { origin: Vector; x: Vector; y: Vector; tangent: Vector } {
    const d = this.axis.distance_mm;
    const span = d[this.steps - 1]! - d[0]!;
    const k = Math.max(0, Math.min(this.steps - 2, Math.floor(((distance - d[0]!) / span) * (this.steps - 1))));
    const from = this.axis.origin_p[k] as Vector, to = this.axis.origin_p[k + 1] as Vector;
    const chord = less(to, from), length = Math.sqrt(dot(chord, chord));
    const tangent = add([0, 0, 0], chord, 1 / length);
    const origin = add(from, chord, (distance - d[k]!) / (d[k + 1]! - d[k]!));
    return { origin, x: this.axis.x_p[k] as Vector, y: this.axis.y_p[k] as Vector, tangent };
  }

  point(distance: number, azimuth: number, radius: number): Vector {
    const { origin, x, y } = this.at(distance);
    return add(add(origin, x, radius * Math.cos(azimuth)), y, radius * Math.sin(azimuth));
  }

  coordinates(p: Vector): { distance: number; azimuth: number; radius: number; outward: Vector } {
    let distance = this.first(p);
    for (let turn = 0; turn < 3; turn++) {
      const { origin, tangent } = this.at(distance);
      distance += dot(less(p, origin), tangent);
    }
    const { origin, x, y } = this.at(distance);
    const away = less(p, origin);
    const [u, v] = [dot(away, x), dot(away, y)];
    const radius = Math.hypot(u, v);
    const outward = add(add([0, 0, 0], x, u / radius), y, v / radius);
    return { distance, azimuth: Math.atan2(v, u), radius, outward };
  }

  private first(p: Vector): number {
    const from = this.axis.origin_p[0] as Vector, to = this.axis.origin_p[this.steps - 1] as Vector;
    const chord = less(to, from);
    const share = dot(less(p, from), chord) / dot(chord, chord);
    const d = this.axis.distance_mm;
    return d[0]! + share * (d[this.steps - 1]! - d[0]!);
  }
}
