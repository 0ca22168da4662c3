/** How good the run is: coverage, what was not used and why, uncertainty, drift, the diagnosis. */
import type { Session } from "./session";
import { element } from "./words";

export function qualityPage(session: Session): HTMLElement {
  const { run } = session;
  const shown = (v: number | string | null) => (v === null ? "–" : typeof v === "number" ? String(Math.round(v * 1e4) / 1e4) : v);
  const rows = (numbers: { name: string; value: number | string | null; unit: string }[]) => numbers.map((n) =>
    element("tr", {}, element("th", { scope: "row" }, n.name), element("td", {}, `${shown(n.value)} ${n.unit}`.trim())));
  const stages = run.numbers.filter((s) => s.numbers.length).map((s) =>
    element("section", {}, element("h3", {}, s.stage), element("table", {}, ...rows(s.numbers))));
  return element("div", { class: "page" },
    element("section", {}, element("h2", {}, "The run in figures"), element("table", {}, ...rows(run.metrics))),
    element("section", {}, element("h2", {}, "Left-out physics"), element("p", {}, run.diagnosis
      ? `${run.diagnosis.verdict}: ${run.diagnosis.statement}`
      : "Not asked for. boresight diagnose compares this recording with what the stated probe predicts.")),
    run.warnings.length ? element("section", {}, element("h2", {}, "Noticed while reading"), element("ul", {}, ...run.warnings.map((w) => element("li", {}, w)))) : null,
    element("h2", {}, "What every stage reports"), element("div", { class: "columns" }, ...stages),
    element("section", {}, element("h2", {}, "Made from"), element("table", {},
      ...Object.entries(run.inputs).map(([k, v]) => element("tr", {}, element("th", { scope: "row" }, k), element("td", {}, `SHA-256 ${v}`))))));
}
