/** The recorded frames that show the spot, with the spot and the laser's ring marked. */
import type { Session } from "./session";
import type { Sight } from "./types";
import { drawn, element } from "./words";

const DELAY_MS = 150;
const CLOSE = 4;

export class FrameView {
  readonly root = element("div", { class: "frames" });
  private readonly tabs = element("div", { class: "bar", role: "tablist" });
  private readonly image = element("img", { alt: "" });
  private readonly marks = drawn("svg", { "aria-hidden": "true" });
  private readonly told = element("p", { class: "told" });
  private timer = 0;
  private readonly close = element("input", { type: "checkbox", id: "close-up", checked: true });
  private readonly light = element("input", { type: "range", min: "1", max: "8", step: "0.5", value: "1", id: "brighten" });
  private readonly frame = element("div", { class: "zoomed", title: "a click moves the spot" }, this.image, this.marks);
  private kind = "";
  private shown: Sight | null = null;

  constructor(private readonly session: Session) {
    this.root.append(element("div", { class: "picture" }, this.frame), this.told);
    this.close.addEventListener("change", () => this.zoom());
    this.light.addEventListener("input", () => { this.image.style.filter = `brightness(${this.light.value})`; });
    this.frame.addEventListener("click", (e) => void this.pick(e));
    new ResizeObserver(() => this.zoom()).observe(this.root);
    session.on(["cursor"], () => this.later());
    this.later();
  }

  /** What stands beside the pane's title. */
  bar(): HTMLElement {
    return element("div", { class: "bar" }, this.tabs, element("label", { for: "close-up" }, this.close, " close-up"),
      element("label", { for: "brighten" }, "brighter ", this.light));
  }

  /** Bring the spot to the middle, enlarged, or show the whole frame. */
  private zoom(): void {
    const box = this.frame.parentElement!, [w, h] = [this.image.naturalWidth, this.image.naturalHeight];
    if (!this.shown || !w || !this.close.checked) { this.frame.style.transform = ""; return; }
    const fit = Math.min(box.clientWidth / w, box.clientHeight / h);
    const [x, y] = [(this.shown.spot_px[0] - w / 2) * fit, (this.shown.spot_px[1] - h / 2) * fit];
    this.frame.style.transform = `scale(${CLOSE}) translate(${-x}px, ${-y}px)`;
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
      this.shown = null;
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

  /** Move the spot to what was clicked. */
  private async pick(event: MouseEvent): Promise<void> {
    const matrix = (this.marks as SVGSVGElement).getScreenCTM();
    if (!this.shown || !matrix) return;
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
    try {
      this.session.moveTo(await this.session.source.spot(this.shown.frame, at.x, at.y));
    } catch (error) {
      this.told.textContent = error instanceof Error ? error.message : String(error);
    }
  }

  private put(sight: Sight): void {
    this.shown = sight;
    this.image.onload = () => {
      this.zoom();
      this.marks.setAttribute("viewBox", `0 0 ${this.image.naturalWidth} ${this.image.naturalHeight}`);
      const [u, v] = sight.spot_px;
      this.marks.replaceChildren(
        ...sight.ring_px.filter((_, k) => k % 3 === 0).map(([x, y]) => drawn("circle", { cx: x, cy: y, r: 1.1, class: "ring" })),
        drawn("circle", { cx: u, cy: v, r: 26, class: "halo" }), drawn("circle", { cx: u, cy: v, r: 26, class: "spot" }),
      );
    };
    this.image.src = this.session.source.frame(sight.frame);
    this.image.alt = `Recorded frame ${sight.frame}, the spot circled`;
    this.told.textContent = `Frame ${sight.frame}, ${sight.time_s.toFixed(2)} s; spot circled${sight.ring_px.length ? ", measured laser line dotted" : ""}.`;
  }
}
