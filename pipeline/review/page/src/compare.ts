/** Two runs of one pipe: their alignment, and which findings grew, are new or are gone. */
import { CompareView } from "./beside";
import { plot } from "./plot";
import type { Session } from "./session";
import type { Change, Comparison, Registration } from "./types";
import { clock, element, measured, number } from "./words";

const DEGREES = 180 / Math.PI;

export function comparePage(session: Session): HTMLElement {
  const root = element("main", { class: "page", id: "compare" }, element("p", { class: "quiet" }, "Aligning the two runs…"));
  let shown: CompareView | null = null;
  const load = async () => {
    const found = await session.source.comparison();
    if (!found) { root.replaceChildren(unasked()); return; }
    shown ??= new CompareView(session, found);
    root.replaceChildren(...parts(session, found, shown));
  };
  const tell = (error: Error) => root.replaceChildren(element("section", {}, element("h2", {}, "Compare"), element("p", { class: "unsigned" }, error.message)));
  session.on(["state"], () => void load().catch(tell));
  void load().catch(tell);
  return root;
}

function unasked(): HTMLElement {
  return element("section", {}, element("h2", {}, "Compare with an earlier run"),
    element("p", {}, "Start the review with the folder of an earlier run of the same pipe: ", element("code", {}, "boresight review RUN --compare EARLIER")));
}

function parts(session: Session, found: Comparison, view: CompareView): HTMLElement[] {
  const folder = session.source.readOnly ? "" : "/api/comparison/";
  view.take(found);
  return [
    element("section", {}, element("h2", {}, `${session.run.name} against ${found.earlier}`), element("p", {}, found.statement)),
    view.root,
    element("section", {}, element("h2", {}, "Outcome of each finding"),
      element("p", { class: "quiet" }, "Depths of both runs are read by the same method within the same outline. Growth into the wall is positive; its σ includes the noise of the sound wall beside the finding, the resolution of the maps, the alignment and the calibration. p is the probability of such a change by chance, corrected for the number of findings (Holm). ◆ marks a change that counts as real."),
      element("div", { class: "scroll" }, growthTable(session, found, view)),
      element("p", {}, element("a", { href: `${folder}growth.csv`, download: "growth.csv" }, "growth.csv"), " ", element("a", { href: `${folder}growth.json`, download: "growth.json" }, "growth.json"))),
    element("section", {}, element("h2", {}, "Alignment of the two runs"), registrationTable(found), element("div", { class: "plots" }, ...courses(found.registration))),
  ];
}

function growthTable(session: Session, { changes, years }: Comparison, view: CompareView): HTMLElement {
  const heads = ["finding", "kind", "place", "outcome", "depth then", "depth now", "growth", "p", "length", "width", "area", ...(years ? ["growth per year"] : [])];
  const rows = changes.map((c) => {
    const open = element("button", { click: () => { view.show(c); view.root.scrollIntoView({ block: "nearest" }); } }, c.id ? session.called(c.id) : `earlier ${c.earlier_id}`);
    const rate = c.depth_rate_mm_per_year === null ? "–" : measured(c.depth_rate_mm_per_year, c.depth_rate_sigma_mm_per_year, "mm");
    const loss = c.wall_loss_rate_percent_per_year === null ? "" : `, ${measured(c.wall_loss_rate_percent_per_year, c.wall_loss_rate_sigma_percent_per_year, "% of the wall")}`;
    const cells = [c.kind, `${number(c.distance_mm, 0)} mm, ${clock(c.azimuth_rad)}`, `${c.changed ? "◆ " : ""}${c.fate}`,
      way(c.earlier_depth_mm), way(c.depth_mm), growth(c.depth_growth_mm, c.depth_growth_sigma_mm, "mm"), chance(c), growth(c.length_growth_mm, c.length_growth_sigma_mm, "mm"),
      growth(c.width_growth_mm, c.width_growth_sigma_mm, "mm"), growth(c.area_growth_mm2, c.area_growth_sigma_mm2, "mm²"), ...(years ? [rate + loss] : [])];
    return element("tr", { class: c.changed ? "strong" : "" }, element("td", {}, open), ...cells.map((text) => element("td", {}, text)));
  });
  return element("table", { class: "grid" }, element("thead", {}, element("tr", {}, ...heads.map((h) => element("th", { scope: "col" }, h)))), element("tbody", {}, ...rows));
}

function growth(value: number | null, sigma: number | null, unit: string): string {
  return value === null ? "–" : `${value > 0 ? "+" : ""}${measured(value, sigma, unit)}`;
}

/** A depth without its σ, which is given for the growth instead. */
function way(mm: number | null): string { return mm === null ? "–" : `${number(Math.abs(mm))} mm ${mm < 0 ? "inward" : "deep"}`; }

function chance({ p_adjusted: p }: Change): string {
  return p === null ? "–" : p < 1e-4 ? "< 0.0001" : p.toPrecision(2);
}

function registrationTable({ registration: r, diameter, one_calibration }: Comparison): HTMLElement {
  const degrees = (angle: number) => number(((((angle * DEGREES) + 180) % 360) + 360) % 360 - 180, 2);
  const facts: [string, string][] = [
    ["shift along the pipe", `${number(r.shift_range_mm[0])} to ${number(r.shift_range_mm[1])} mm, each ± ${number(r.shift_sigma_mm[0])} mm`],
    ["scale along the pipe", measured(r.scale, r.scale_sigma, "")],
    ["roll", `${degrees(r.roll_range_rad[0])} to ${degrees(r.roll_range_rad[1])}°, each ± ${number((r.roll_sigma_rad[0] ?? 0) * DEGREES)}°`],
    ["seen in both runs", `${number(r.overlap_mm[0], 0)} to ${number(r.overlap_mm[1], 0)} mm`],
    ["pieces of wall that agree", `${r.agreeing} of ${r.blocks}, correlation ${number(r.correlation)}; by chance with a probability of ${r.chance.toExponential(0)}`],
    ["welds found in both", r.welds.length ? r.welds.map((w) => `${number(w.earlier_mm, 1)} → ${number(w.now_mm, 1)} mm`).join(", ") : "none"],
    ["growth of the mean diameter", `${measured(diameter.value, diameter.sigma)}${one_calibration ? ", with one calibration" : ", each run with its own calibration"}`],
  ];
  return element("table", {}, ...facts.map(([k, v]) => element("tr", {}, element("th", { scope: "row" }, k), element("td", {}, v))));
}

function courses(r: Registration): HTMLElement[] {
  const x = r.at_mm, x_label = "distance in the earlier run, mm";
  return [
    plot({ title: "Shift along the pipe", unit: "mm", x_label, x, curves: [{ name: "shift", y: r.shift_mm }] }),
    plot({ title: "Roll", unit: "°", x_label, x, curves: [{ name: "roll", y: r.roll_rad.map((v) => v * DEGREES) }] }),
  ];
}
