/** The bar above the flat view: layers with their legend, measuring tools, drawing. */
import type { Session } from "./session";
import type { Reading, SavedReading, Tool } from "./types";
import { layerChoice, legend } from "./legend";
import { clock, clockOfHours, element, measured, moment } from "./words";

const TOOLS: [Tool, string, number][] = [
  ["point", "Point", 1], ["distance", "Distance", 2], ["area", "Area", 3], ["depth", "Depth", 3], ["diameter", "Diameter", 1],
];
const HELP: Partial<Record<Tool, string>> = {
  point: "Point: click the wall for radius, distance and clock.",
  distance: "Distance: click two points.",
  area: "Area: click three or more corners.",
  depth: "Depth against the surrounding wall: click three or more points around the defect.",
  diameter: "Diameter: click a point; the diameter through it is measured.",
  redraw: "Drag the outline's points, or click around the defect for a new outline; then Done.",
  add: "Missed defect: click around it, choose its kind, then Done.",
  split: "Click around the first part, Next part, around the second, then Done.",
};
const KEYS_HINT = " Keyboard: arrows, Enter sets a point, Backspace takes it back, Esc leaves.";

export class ToolBar {
  readonly root = element("div", { class: "tools" });
  readonly status = element("p", { class: "status", role: "status" });
  private readonly buttons = element("div", { class: "bar" });
  private readonly kind = element("select", { "aria-label": "kind of the missed defect" });
  private parts: [number, number][][] = [];

  constructor(private readonly session: Session) {
    this.kind.append(element("option", { value: "" }, "kind…"), ...session.run.kinds.map((k) => element("option", { value: k }, k)));
    this.root.append(this.buttons);
    session.on(["tool", "selection", "readings"], () => this.offer());
    session.on(["shape"], () => void this.drawn());
    session.on(["cursor"], () => this.place());
    this.offer();
    this.place();
  }

  /** The controls beside the pane's title: what both views of the wall show, and its colours. */
  bar(): HTMLElement {
    return element("div", { class: "bar" }, element("label", {}, "shows ", layerChoice(this.session, "what the wall shows")), legend(this.session));
  }

  private offer(): void {
    const { session } = this;
    const drawing = ["redraw", "add", "split"].includes(session.tool);
    if (!drawing) this.parts = [];
    const toggles = session.source.readOnly ? [] : TOOLS.map(([tool, name]) => element("button", {
      "aria-pressed": String(session.tool === tool), click: () => session.take(session.tool === tool ? "none" : tool),
    }, name));
    const add = session.source.readOnly ? null : element("button", { "aria-pressed": String(session.tool === "add"), click: () => session.take("add") }, "Add defect");
    this.buttons.replaceChildren(toggles.length ? "Measure " : "", ...toggles, add ?? "",
      session.tool === "add" ? this.kind : "", drawing ? element("button", { class: "accept", click: () => void this.finish() }, "Done") : "",
      session.tool === "split" ? element("button", { click: () => this.nextPart() }, "Next part") : "",
      session.tool !== "none" ? element("button", { click: () => this.leave() }, "Cancel") : "", this.saved());
    if (session.tool === "none") this.place();
    else this.status.textContent = (HELP[session.tool] ?? "") + KEYS_HINT;
  }

  /** The saved measurements: their number, a table to download, and a button to delete them. */
  private saved(): HTMLElement | string {
    const { session } = this, { readings } = session;
    if (!readings.length) return "";
    const table = `data:text/csv;charset=utf-8,${encodeURIComponent(csv(readings))}`;
    return element("span", { class: "bar" }, element("a", { href: table, download: `${session.run.name}-measurements.csv`, title: readings.map((r) => sentence(r.readings)).join("\n") },
      `${readings.length} saved (CSV)`), element("button", { title: "delete the saved measurements", click: () => session.forget() }, "Clear"));
  }

  leave(): void { this.parts = []; this.kind.value = ""; this.session.take("none"); }

  nextPart(): void {
    if (this.session.drawn.length < 3) { this.session.say("A part needs three points."); return; }
    this.parts.push(this.session.drawn);
    this.session.drawn = [];
    this.session.tell("shape");
  }

  async finish(): Promise<void> {
    const { session } = this;
    const outline = session.drawn;
    if (outline.length < 3) { session.say("An outline needs three points."); return; }
    if (session.tool === "add" && !this.kind.value) { session.say("Choose the kind of the missed defect."); this.kind.focus(); return; }
    const done = session.tool === "redraw" ? await session.act({ do: "redraw", finding: session.selected, outline })
      : session.tool === "add" ? await session.act({ do: "add", kind: this.kind.value, outline })
        : await session.act({ do: "split", finding: session.selected, outlines: [...this.parts, outline] });
    if (!done) return;
    const made = session.tool === "add" ? session.state.findings.find((f) => f.id === `a${session.state.revision}`) : session.finding;
    this.leave();
    if (made && made.id !== session.selected) session.select(made.id);
    if (made?.cautions.length) session.say(`Finding ${made.label}: ${made.cautions[0]}`);
  }

  private async drawn(): Promise<void> {
    const { session } = this;
    const wanted = TOOLS.find(([tool]) => tool === session.tool);
    if (!wanted || session.drawn.length < wanted[2]) return;
    const points = ["area", "depth"].includes(session.tool) ? session.drawn : session.drawn.slice(-wanted[2]);
    if (points.length !== session.drawn.length) { session.drawn = points; session.tell("shape"); return; }
    try {
      const readings = await session.source.measure(session.tool, points);
      this.status.replaceChildren(sentence(readings), " ", element("button", {
        click: () => session.keep({ tool: session.tool, at: new Date().toISOString(), points, readings }),
      }, "Save"));
    } catch (error) {
      this.status.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  private place(): void {
    const [distance, azimuth] = this.session.cursor;
    if (this.session.tool === "none") this.status.textContent = `Spot at ${distance.toFixed(1)} mm, ${clock(azimuth)} o'clock.`;
  }
}

/** Readings in words; a clock position is not written as a decimal number. */
function sentence(readings: Reading[]): string {
  return readings.map((r) => (r.unit === "h" ? `${r.name} ${clockOfHours(r.value)} ± ${(60 * r.sigma).toFixed(1)} min` : `${r.name} ${measured(r.value, r.sigma, r.unit)}`)).join("; ");
}

function csv(saved: SavedReading[]): string {
  const rows = saved.flatMap((m) => m.readings.map((r) => [moment(m.at), m.tool, r.name, r.value, r.sigma, r.unit,
    m.points.map(([s, a]) => `${s.toFixed(2)} mm at ${clock(a)}`).join(" / ")].join(",")));
  return ["measured at,tool,quantity,value,1 sigma,unit,points", ...rows].join("\n") + "\n";
}
