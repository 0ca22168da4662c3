/** A small line chart with its 1 σ band. */
import type { Curve } from "./types";
import { drawn, element } from "./words";

const [WIDTH, HEIGHT, LEFT, BOTTOM] = [300, 110, 40, 22];

export function chart(curve: Curve, title: string): HTMLElement {
  const seen = curve.mm.map((x, k) => [x, curve.depth_mm[k] ?? null, curve.sigma_mm[k] ?? 0] as const)
    .filter((p): p is readonly [number, number, number] => p[1] !== null);
  const root = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title, class: "chart" });
  if (!seen.length) return element("figure", {}, element("figcaption", {}, `${title}: not seen`));
  const reach = Math.max(0.1, ...seen.map((p) => Math.abs(p[1]) + p[2]));
  const [x0, x1] = [curve.mm[0]!, curve.mm[curve.mm.length - 1]!];
  const x = (v: number) => LEFT + ((WIDTH - LEFT - 6) * (v - x0)) / (x1 - x0);
  const y = (v: number) => 6 + ((HEIGHT - BOTTOM - 6) * (v + reach)) / (2 * reach);
  const line = (sign: number) => seen.map(([at, d, s]) => `${x(at).toFixed(1)} ${y(d + sign * s).toFixed(1)}`);
  root.append(
    drawn("path", { d: `M${line(1).join("L")}L${line(-1).reverse().join("L")}Z`, class: "band" }),
    drawn("line", { x1: LEFT, x2: WIDTH - 6, y1: y(0), y2: y(0), class: "zero" }),
    drawn("path", { d: `M${line(0).join("L")}`, class: "curve" }),
    drawn("text", { x: LEFT - 4, y: y(0) + 4, "text-anchor": "end" }, "0"),
    drawn("text", { x: LEFT - 4, y: y(-reach) + 8, "text-anchor": "end", class: "inward" }, reach.toFixed(1)),
    drawn("text", { x: LEFT + 2, y: y(-reach) + 8, class: "inward" }, "inward"),
    drawn("text", { x: LEFT - 4, y: y(reach), "text-anchor": "end", class: "deep" }, reach.toFixed(1)),
    drawn("text", { x: LEFT + 2, y: y(reach), class: "deep" }, "deep"),
    drawn("text", { x: LEFT, y: HEIGHT - 5 }, `${x0.toFixed(0)} mm`),
    drawn("text", { x: WIDTH - 6, y: HEIGHT - 5, "text-anchor": "end" }, `${x1.toFixed(0)} mm`),
  );
  return element("figure", {}, element("figcaption", {}, `${title}: depth in mm, into the wall downward; band: 1 σ`), root);
}
