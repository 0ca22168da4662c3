/** How good the run is: coverage, what was not used and why, uncertainty, drift, the diagnosis. */
import { plot } from "./plot";
import type { Session } from "./session";
import type { Quality, Quantity } from "./types";
import { element, number } from "./words";

export function qualityPage(session: Session): HTMLElement {
  const { run } = session;
  const measured = element("div", {}, element("p", { class: "quiet" }, "Loading…"));
  const pictures = element("div", { class: "pictures" });
  const load = () => session.source.quality().then((quality) => {
    measured.replaceChildren(...sections(quality));
    pictures.replaceChildren(...quality.pictures.map((p) =>
      element("figure", {}, element("img", { src: p.source, alt: p.title }), element("figcaption", {}, p.title))));
  }).catch((error: Error) => measured.replaceChildren(element("p", { class: "unsigned" }, error.message)));
  const stages = run.numbers.filter((s) => s.numbers.length).map((s) =>
    element("section", {}, element("h3", {}, s.stage), element("table", {}, ...rows(s.numbers))));
  const root = element("main", { class: "page" },
    element("section", {}, element("h2", {}, "The run in figures"), element("table", { class: "wide" }, ...rows(run.metrics))),
    measured,
    element("section", {}, element("h2", {}, "Instrument diagnosis"), element("p", {}, run.diagnosis
      ? `${run.diagnosis.verdict}: ${run.diagnosis.statement}`
      : "Not run. boresight diagnose tests whether the instrument was as its probe file states. To show the answer here, copy its diagnosis.json and diagnosis.html into the run folder."), pictures),
    run.warnings.length ? element("section", {}, element("h2", {}, "Warnings of this run"), element("ul", {}, ...run.warnings.map((w) => element("li", {}, w)))) : null,
    element("details", {}, element("summary", {}, "All figures, stage by stage"), element("div", { class: "columns" }, ...stages)),
    element("section", {}, element("h2", {}, "Input files"), element("table", {},
      ...Object.entries(run.inputs).map(([k, v]) => element("tr", {}, element("th", { scope: "row" }, k), element("td", {}, `SHA-256 ${v}`))))));
  // Requested when it is first opened: the first view needs all of the server.
  const seen = new IntersectionObserver((all) => { if (all.some((e) => e.isIntersecting)) { seen.disconnect(); void load(); } });
  seen.observe(root);
  return root;
}

function rows(numbers: Quantity[]): HTMLElement[] {
  const shown = (v: number | string | null) => (v === null ? "–" : typeof v === "number" ? String(Number.isInteger(v) ? v : Number(v.toPrecision(5))) : v);
  return numbers.map((n) => element("tr", {}, element("th", { scope: "row" }, n.name), element("td", {}, `${shown(n.value)} ${n.unit}`.trim())));
}

function sections({ plots, samples, facts }: Quality): HTMLElement[] {
  return [
    element("section", {}, element("h2", {}, "Along the pipe"), element("div", { class: "plots" }, ...plots.map(plot))),
    element("section", {}, element("h2", {}, "Ring samples used, and why others were not"), element("table", {},
      ...samples.map((s) => element("tr", {}, element("th", { scope: "row" }, s.reason),
        element("td", { class: "count" }, String(s.count)), element("td", { class: "count" }, `${number(s.share_percent, 2)} %`))))),
    element("section", {}, element("h2", {}, "Instrument"), element("table", {}, ...rows(facts))),
  ];
}
