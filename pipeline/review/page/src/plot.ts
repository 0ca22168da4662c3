/** Curves over one axis, with a scale and a key. */
import type { Plot } from "./types";
import { drawn, element, number } from "./words";

const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM] = [520, 170, 56, 10, 10, 34];

export function plot({ title, x_label, unit, x, curves }: Plot): HTMLElement {
  const root = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title, class: "chart" });
  const all = curves.flatMap((c) => c.y).filter((v): v is number => v !== null);
  if (!all.length || !x.length) return element("figure", {}, element("figcaption", {}, `${title}: nothing was measured.`));
  const [low, most] = range(Math.min(...all), Math.max(...all));
  const high = unit === "%" ? Math.min(most, 100) : most;
  const [first, last] = [x[0]!, x[x.length - 1]!];
  const px = (v: number) => LEFT + ((WIDTH - LEFT - RIGHT) * (v - first)) / (last - first || 1);
  const py = (v: number) => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * (v - low)) / (high - low);
  const digits = Math.max(0, Math.min(5, 1 - Math.floor(Math.log10(high - low))));
  for (const share of [0, 0.5, 1]) {
    const v = low + share * (high - low);
    root.append(drawn("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: py(v), y2: py(v), class: "zero" }),
      drawn("text", { x: LEFT - 5, y: py(v) + 4, "text-anchor": "end" }, number(v, digits)));
  }
  curves.forEach((c, k) => root.append(drawn("path", { d: line(x.map(px), c.y, py), class: `curve c${k}` })));
  root.append(drawn("text", { x: LEFT, y: HEIGHT - 18 }, number(first, 0)), drawn("text", { x: WIDTH - RIGHT, y: HEIGHT - 18, "text-anchor": "end" }, number(last, 0)),
    drawn("text", { x: (LEFT + WIDTH) / 2, y: HEIGHT - 4, "text-anchor": "middle" }, x_label));
  const key = curves.length > 1 ? element("span", { class: "quiet" }, ": ", ...curves.flatMap((c, k) => [element("i", { class: `swatch c${k}` }), ` ${c.name}  `])) : null;
  return element("figure", {}, element("figcaption", {}, `${title}${unit ? `, ${unit}` : ""}`, key), root);
}

function range(low: number, high: number): [number, number] {
  const room = high - low || Math.abs(high) || 1;
  return low >= 0 && low < room ? [0, high + 0.06 * room] : [low - 0.06 * room, high + 0.06 * room];
}

function line(x: number[], y: (number | null)[], py: (v: number) => number): string {
  let text = "", open = false;
  y.forEach((v, k) => {
    if (v === null) { open = false; return; }
    text += `${open ? "L" : "M"}${x[k]!.toFixed(1)} ${py(v).toFixed(1)}`;
    open = true;
  });
  return text;
}
