/** Notices beside the findings: the warnings of the run, and places shown by one ring only. */
import type { Session } from "./session";
import { TileLayer } from "./tiles";
import type { Point, Unconfirmed } from "./types";
import { azimuthOf, clockOfHours, depth, element, number } from "./words";

const SIDE_PX = 96;
const LEAST_HALF_MM = 6;

/** The warnings of the run, in full. */
export function warnings(told: string[]): HTMLElement | string {
  if (!told.length) return "";
  const one = told.length === 1;
  return element("details", { class: "warnings caution", open: true }, element("summary", {}, one ? "This run warns:" : `This run gives ${told.length} warnings:`),
    element("ul", {}, ...told.map((text) => element("li", {}, text))));
}

/** The places that are not counted as findings, each with its photo and the reason; a click goes there. */
export function unconfirmed(session: Session): HTMLElement | string {
  const { unconfirmed: items } = session.run;
  if (!items.length) return "";
  const photo = new TileLayer(session.source, () => { for (const draw of draws) draw(); });
  const draws: (() => void)[] = [];
  const rows = items.map((item) => {
    const canvas = element("canvas", { width: String(SIDE_PX), height: String(SIDE_PX), role: "img", "aria-label": `Photo of the place at ${number(item.distance_from_mm, 0)} mm` });
    draws.push(() => paint(canvas, photo, item, session.run.radius_mm));
    const go = () => session.moveTo(middleOf(item));
    return element("li", {}, element("button", { click: go, title: "go there" }, canvas), element("div", {},
      element("strong", {}, `${item.kind}, ${depth(item.depth_mm, item.depth_sigma_mm)}`),
      element("p", {}, `${number(middleOf(item)[0], 1)} mm, ${clockOfHours(item.peak_clock ?? (item.clock_from + item.clock_to) / 2)}`),
      element("p", { class: "quiet" }, item.statement)));
  });
  const root = element("details", { class: "unconfirmed" },
    element("summary", {}, items.length === 1 ? "1 unconfirmed place" : `${items.length} unconfirmed places`),
    element("p", { class: "quiet" }, "Each of these is shown by one laser ring alone or by the photo alone, or recordings like this one hold more false findings of its kind than real ones. They are not counted as findings. If one is a defect, draw it with “Add defect”."),
    element("ul", {}, ...rows));
  root.addEventListener("toggle", () => { if (root.open && !photo.layer) void photo.load("photo").then(() => draws.forEach((draw) => draw())).catch((e: Error) => session.say(e.message)); });
  return root;
}

function middleOf(item: Unconfirmed): Point {
  return [item.peak_distance_mm ?? (item.distance_from_mm + item.distance_to_mm) / 2, azimuthOf(item.peak_clock ?? (item.clock_from + item.clock_to) / 2)];
}

function paint(canvas: HTMLCanvasElement, photo: TileLayer, item: Unconfirmed, radius: number): void {
  const context = canvas.getContext("2d")!, [s, a] = middleOf(item);
  const half = Math.max(item.length_mm, item.width_mm, LEAST_HALF_MM), mmPerPx = (2 * half) / SIDE_PX;
  const x = (mm: number) => SIDE_PX / 2 + (mm - s) / mmPerPx, y = (at: number) => SIDE_PX / 2 + ((at - a) * radius) / mmPerPx;
  context.clearRect(0, 0, SIDE_PX, SIDE_PX);
  photo.paint(context, { x, y, size: [SIDE_PX, SIDE_PX], span: [s - half, s + half], mmPerPx });
  const turn = Math.round((item.outline[0]![1] - a) / (2 * Math.PI)) * 2 * Math.PI;
  for (const [colour, width] of [["#000000", 4], ["#ffffff", 1.6]] as [string, number][]) {
    context.beginPath();
    item.outline.forEach(([mm, at], k) => context[k ? "lineTo" : "moveTo"](x(mm), y(at - turn)));
    context.closePath();
    [context.strokeStyle, context.lineWidth] = [colour, width];
    context.stroke();
  }
}
