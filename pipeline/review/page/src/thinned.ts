/** A coarser surface with the same vertices, for a browser without a graphics card, while the view moves. */
import type { Point } from "./types";

/**
 * Triangles between the first vertices of cells of distance and azimuth; `at` gives each vertex's distance and azimuth in turn
 * and `cell` the sizes in mm and rad. Vertices at the edges of the skin stay, so that parts still meet.
 */
export function thinned(index: ArrayLike<number>, at: Float64Array, cell: Point): Uint32Array {
  const stands = standIns(index, at, cell);
  const out = new Uint32Array(index.length);
  let n = 0;
  for (let k = 0; k < index.length; k += 3) {
    const [a, b, c] = [stands[index[k]!]!, stands[index[k + 1]!]!, stands[index[k + 2]!]!];
    if (a === b || b === c || c === a) continue;
    out[n++] = a; out[n++] = b; out[n++] = c;
  }
  return out.slice(0, n);
}

/** For each vertex the one that replaces it: the first of its cell, or itself at an edge. */
function standIns(index: ArrayLike<number>, at: Float64Array, cell: Point): Uint32Array {
  // Around an inner vertex each neighbour follows one triangle's corner and precedes another's: the differences cancel.
  const open = new Float64Array(at.length / 2);
  for (let k = 0; k < index.length; k += 3) {
    const [a, b, c] = [index[k]!, index[k + 1]!, index[k + 2]!];
    open[a]! += b - c; open[b]! += c - a; open[c]! += a - b;
  }
  const across = Math.ceil((2 * Math.PI) / cell[1]) + 2;
  const key = (k: number) => Math.floor(at[2 * k]! / cell[0]) * across + Math.floor((at[2 * k + 1]! + Math.PI) / cell[1]);
  let [least, most] = [Infinity, -Infinity];
  for (let k = 0; k < open.length; k++) { const n = key(k); least = Math.min(least, n); most = Math.max(most, n); }
  const first = new Int32Array(open.length ? most - least + 1 : 0).fill(-1), out = new Uint32Array(open.length);
  for (let k = 0; k < open.length; k++) {
    const n = key(k) - least;
    if (!open[k] && first[n]! < 0) first[n] = k;
    out[k] = open[k] ? k : first[n]!;
  }
  return out;
}
