/** The recorded frames that show the spot, with the spot and the laser's ring marked. */
import type { Session } from "./session";
import type { Sight } from "./types";
import { drawn, element } from "./words";

const DELAY_MS = 150;

export class FrameView {
  readonly root = element("div", { class: "frames" });
  private readonly tabs = element("div", { class: "bar", role: "tablist" });
  private readonly image = element("img", { alt: "" });
  private readonly marks = drawn("svg", { "aria-hidden": "true" });
  private readonly told = element("p", { class: "told" });
  private timer = 0;
  private kind = "";

  constructor(private readonly session: Session) {
    this.root.append(this.tabs, element("div", { class: "picture" }, this.image, this.marks), this.told);
    session.on(["cursor"], () => this.later());
    this.later();
  }

  private later(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.load(), DELAY_MS);
  }

  private async load(): Promise<void> {
    const [distance, azimuth] = this.session.cursor;
    try {
      const sights = await this.session.source.sights(distance, azimuth);
      this.offer(sights);
    } catch (error) {
      this.tabs.replaceChildren();
      this.image.removeAttribute("src");
      this.marks.replaceChildren();
      this.told.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  private offer(sights: Sight[]): void {
    const chosen = sights.find((s) => s.illumination === this.kind) ?? sights[0]!;
    this.tabs.replaceChildren(...sights.map((s) => element("button", {
      role: "tab", "aria-selected": String(s === chosen), click: () => { this.kind = s.illumination; this.offer(sights); },
    }, `${s.illumination === "led" ? "lit" : s.illumination} frame ${s.frame}`)));
    this.put(chosen);
  }

  private put(sight: Sight): void {
    this.image.onload = () => {
      this.marks.setAttribute("viewBox", `0 0 ${this.image.naturalWidth} ${this.image.naturalHeight}`);
      const [u, v] = sight.spot_px;
      this.marks.replaceChildren(
        ...sight.ring_px.filter((_, k) => k % 3 === 0).map(([x, y]) => drawn("circle", { cx: x, cy: y, r: 1.6, class: "ring" })),
        drawn("circle", { cx: u, cy: v, r: 26, class: "halo" }), drawn("circle", { cx: u, cy: v, r: 26, class: "spot" }),
      );
    };
    this.image.src = this.session.source.frame(sight.frame);
    this.image.alt = `Recorded frame ${sight.frame}, the spot circled`;
    this.told.textContent = `Frame ${sight.frame}, ${sight.time_s.toFixed(2)} s${sight.ring_px.length ? "; the measured laser line is dotted" : ""}`;
  }
}
