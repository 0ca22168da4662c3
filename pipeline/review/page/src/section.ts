/** The cross-section at the spot: nominal, fitted and measured circle, deviations exaggerated. */
import type { Session } from "./session";
import type { Section } from "./types";
import { clock, drawn, element, measured, wrapped } from "./words";

const SIZE = 300;
const RADIUS = 108;

export class SectionView {
  readonly root = element("div", { class: "section" });
  private readonly picture = drawn("svg", { viewBox: `0 0 ${SIZE} ${SIZE}`, role: "img", "aria-label": "Cross-section at the spot" });
  private readonly told = element("p", { class: "told" });
  private readonly gain = element("select", { "aria-label": "exaggeration of deviations" },
    ...["1", "5", "20", "50"].map((g) => element("option", { value: g, selected: g === "20" }, `${g}×`)));
  private wanted = 0;
  private current: Section | null = null;

  constructor(private readonly session: Session) {
    this.root.append(this.picture, this.told);
    this.gain.addEventListener("change", () => this.paint());
    session.on(["cursor"], () => void this.load());
    this.picture.addEventListener("click", (e) => this.pick(e as MouseEvent));
    void this.load();
  }

  /** The controls beside the pane's title. */
  bar(): HTMLElement {
    const key = (name: string, shown: string) => {
      const line = drawn("svg", { viewBox: "0 0 26 8", class: "key", "aria-hidden": "true" });
      line.append(drawn("line", { x1: 0, x2: 26, y1: 4, y2: 4, class: name }));
      return element("span", { class: "quiet" }, line, ` ${shown}`);
    };
    return element("div", { class: "bar" }, element("label", { title: "deviations are drawn this much larger" }, "deviation ", this.gain),
      key("nominal", "nominal"), key("fitted", "fitted"), key("measured", "measured"));
  }

  private async load(): Promise<void> {
    const turn = ++this.wanted;
    try {
      const section = await this.session.source.section(this.session.cursor[0]);
      if (turn !== this.wanted) return;
      this.current = section;
      this.paint();
    } catch (error) {
      this.told.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  private paint(): void {
    const section = this.current;
    if (!section) return;
    const gain = Number(this.gain.value);
    const place = (r: number, a: number): [number, number] => {
      const shown = RADIUS * (1 + (gain * (r - section.nominal_mm)) / section.nominal_mm);
      return [SIZE / 2 + shown * Math.cos(a), SIZE / 2 + shown * Math.sin(a)];
    };
    const parts: SVGElement[] = [drawn("circle", { cx: SIZE / 2, cy: SIZE / 2, r: RADIUS, class: "nominal" })];
    parts.push(drawn("path", { d: path(section.azimuth_rad, section.fitted_mm, place), class: "fitted" }));
    parts.push(drawn("path", { d: path(section.azimuth_rad, section.radius_mm, place), class: "measured" }));
    for (const hour of [12, 3, 6, 9]) {
      const a = ((hour - 3) * Math.PI) / 6;
      parts.push(drawn("text", { x: SIZE / 2 + 140 * Math.cos(a), y: SIZE / 2 + 140 * Math.sin(a) }, String(hour)));
    }
    const a = this.session.cursor[1];
    const [x, y] = [SIZE / 2 + (RADIUS + 22) * Math.cos(a), SIZE / 2 + (RADIUS + 22) * Math.sin(a)];
    parts.push(drawn("line", { x1: SIZE / 2, y1: SIZE / 2, x2: x, y2: y, class: "spot" }));
    this.picture.replaceChildren(...parts);
    this.told.textContent = this.words(section, a);
  }

  private words(section: Section, azimuth: number): string {
    const n = section.azimuth_rad.length;
    const k = (Math.round(((azimuth - section.azimuth_rad[0]!) / (2 * Math.PI)) * n) + n) % n;
    const seen = section.radius_mm.filter((r): r is number => r !== null);
    const mean = seen.length ? (2 * seen.reduce((sum, r) => sum + r, 0)) / seen.length : null;
    return `Radius at ${clock(azimuth)}: ${measured(section.radius_mm[k] ?? null, section.sigma_mm[k] ?? null)}. Mean diameter `
      + `${mean === null ? "not seen" : mean.toFixed(2) + " mm"} (nominal ${(2 * section.nominal_mm).toFixed(1)}).`;
  }

  private pick(event: MouseEvent): void {
    const box = this.picture.getBoundingClientRect();
    const azimuth = Math.atan2(event.clientY - box.top - box.height / 2, event.clientX - box.left - box.width / 2);
    this.session.moveTo([this.session.cursor[0], wrapped(azimuth)]);
  }
}

function path(azimuth: number[], radius: (number | null)[], place: (r: number, a: number) => [number, number]): string {
  let text = "", open = false;
  [...azimuth.keys(), 0].forEach((k) => {
    const r = radius[k] ?? null;
    if (r === null) { open = false; return; }
    const [x, y] = place(r, azimuth[k]!);
    text += `${open ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
    open = true;
  });
  return text;
}
