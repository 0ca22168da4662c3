/** Pipe coordinates: conversion between points in space (mm) and distance and azimuth about the axis. */
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

  /** The same for many points (x, y, z in turn, in units of `mm`): distance and azimuth in turn, and the deviation of each from a radius. */
  locate(points: ArrayLike<number>, mm: number, radius: number): { at: Float64Array; away: Float32Array } {
    const count = points.length / 3, at = new Float64Array(2 * count), away = new Float32Array(3 * count), { steps } = this;
    const d = Float64Array.from(this.axis.distance_mm), last = d[steps - 1]!, [o, ex, ey] = [this.axis.origin_p, this.axis.x_p, this.axis.y_p].map((v) => Float64Array.from(v.flat())) as [Float64Array, Float64Array, Float64Array];
    const [cx, cy, cz] = [0, 1, 2].map((n) => o[3 * (steps - 1) + n]! - o[n]!) as Vector, whole = cx * cx + cy * cy + cz * cz;
    for (let i = 0; i < count; i++) {
      const x = points[3 * i]! / mm, y = points[3 * i + 1]! / mm, z = points[3 * i + 2]! / mm;
      let s = d[0]! + (((x - o[0]!) * cx + (y - o[1]!) * cy + (z - o[2]!) * cz) / whole) * (last - d[0]!);
      for (let turn = 0; ; turn++) {
        const k = Math.max(0, Math.min(steps - 2, Math.floor(((s - d[0]!) / (last - d[0]!)) * (steps - 1)))), j = 3 * k;
        const gx = o[j + 3]! - o[j]!, gy = o[j + 4]! - o[j + 1]!, gz = o[j + 5]! - o[j + 2]!, t = (s - d[k]!) / (d[k + 1]! - d[k]!);
        const ax = x - o[j]! - t * gx, ay = y - o[j + 1]! - t * gy, az = z - o[j + 2]! - t * gz;
        if (turn < 3) { s += (ax * gx + ay * gy + az * gz) / Math.sqrt(gx * gx + gy * gy + gz * gz); continue; }
        const u = ax * ex[j]! + ay * ex[j + 1]! + az * ex[j + 2]!, v = ax * ey[j]! + ay * ey[j + 1]! + az * ey[j + 2]!, r = Math.sqrt(u * u + v * v);
        at[2 * i] = s; at[2 * i + 1] = Math.atan2(v, u);
        for (let n = 0; n < 3; n++) away[3 * i + n] = ((u * ex[j + n]! + v * ey[j + n]!) / r) * (r - radius) * mm;
        break;
      }
    }
    return { at, away };
  }

  private first(p: Vector): number {
    const from = this.axis.origin_p[0] as Vector, to = this.axis.origin_p[this.steps - 1] as Vector;
    const chord = less(to, from);
    const share = dot(less(p, from), chord) / dot(chord, chord);
    const d = this.axis.distance_mm;
    return d[0]! + share * (d[this.steps - 1]! - d[0]!);
  }
}
