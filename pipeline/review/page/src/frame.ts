/** The recorded frames that show the chosen place, lit and laser frame beside each other, with the place and the laser's ring marked. */
import { FOV_STAND } from "./eye";
import type { Session } from "./session";
import type { Point, Sight } from "./types";
import { drawn, element } from "./words";

const DELAY_MS = 150;
const LONG_MS = 200; // after this time a loading message is shown
const CLOSE = 4;

export class FrameView {
  readonly root = element("div", { class: "frames" });
  private readonly told = element("p", { class: "told" });
  private timer = 0;
  private turn = 0;
  private readonly close = element("input", { type: "checkbox", id: "close-up", checked: true });
  private readonly light = element("input", { type: "range", min: "1", max: "8", step: "0.5", value: "1", id: "brighten" });
  private readonly row = element("div", { class: "shots" });
  private readonly alike = element("input", { type: "checkbox", id: "alike" });
  private shots: Shot[] = [];

  /** `sizeOfModel` gives the pixel size of the model's picture, which a frame in the same view gets too; frames are requested after `first`. */
  constructor(private readonly session: Session, private readonly sizeOfModel: () => Point, private readonly first: Promise<void>) {
    this.root.append(this.row, this.told);
    this.close.addEventListener("change", () => this.zoom());
    this.light.addEventListener("input", () => this.brighten());
    new ResizeObserver(() => this.zoom()).observe(this.root);
    this.alike.addEventListener("change", () => { if (!this.alike.checked) session.standAs(null); void this.load(); });
    session.on(["cursor"], () => this.later());
    session.on(["stand"], () => { if (!session.stand && this.alike.checked) { this.alike.checked = false; void this.load(); } });
    this.later();
  }

  /** The controls beside the pane's title. */
  bar(): HTMLElement {
    return element("div", { class: "bar" },
      !this.session.source.readOnly && element("label", { for: "alike", title: "the model from where the frame was taken, in its light; the frame through the model's lens" },
        this.alike, " same view as model"),
      element("label", { for: "close-up" }, this.close, " close-up"),
      element("label", { for: "brighten" }, "brighter ", this.light));
  }

  private zoom(): void { for (const shot of this.shots) shot.zoom(this.close.checked && !this.alike.checked); }
  private brighten(): void { for (const shot of this.shots) shot.image.style.filter = `brightness(${this.light.value})`; }

  private later(): void {
    window.clearTimeout(this.timer);
    this.timer = window.setTimeout(() => void this.load(), DELAY_MS);
  }

  private async load(): Promise<void> {
    const [distance, azimuth] = this.session.cursor, turn = ++this.turn;
    const telling = window.setTimeout(() => this.tell(this.alike.checked ? "Loading a recorded frame in the model's view…" : "Loading the recorded frames…"), LONG_MS);
    this.root.setAttribute("aria-busy", "true");
    try {
      await this.first;
      if (turn !== this.turn) return;
      const sights = await this.session.source.sights(distance, azimuth);
      if (turn !== this.turn) return;
      const lit = this.alike.checked && sights.find((s) => s.illumination !== "laser");
      if (lit) await this.compare(lit, [distance, azimuth], turn);
      else this.show(sights);
    } catch (error) {
      if (turn !== this.turn) return;
      this.shots = [];
      this.row.replaceChildren();
      this.tell(error instanceof Error ? error.message : String(error));
    } finally {
      window.clearTimeout(telling);
      if (turn === this.turn) this.root.removeAttribute("aria-busy");
    }
  }

  private tell(words: string): void { this.told.textContent = words; }

  /** Show a frame and the model from the same place, through the same lens, in the same light. */
  private async compare(sight: Sight, at: Point, turn: number): Promise<void> {
    const stand = await this.session.source.stand(sight.frame, at);
    if (turn !== this.turn || !this.alike.checked) return;
    this.session.standAs(stand);
    const [width, height] = this.sizeOfModel();
    const shot = new Shot(() => undefined);
    shot.put({ ...sight, spot_px: [width / 2, height / 2], ring_px: [] }, this.session.source.seenFrom(sight.frame, at, FOV_STAND, width, height), () => undefined);
    this.shots = [shot];
    this.row.replaceChildren(shot.root);
    this.brighten();
    this.tell(`Frame ${sight.frame} (${lightOf(sight)}) at ${sight.time_s.toFixed(2)} s, seen as the model is: same place, lens and light.`);
  }

  private show(sights: Sight[]): void {
    const ordered = [...sights].sort((a, b) => Number(a.illumination === "laser") - Number(b.illumination === "laser")); // lit first
    while (this.shots.length < ordered.length) this.shots.push(new Shot((sight, u, v) => void this.pick(sight, u, v)));
    this.shots.length = ordered.length;
    this.row.replaceChildren(...this.shots.map((s) => s.root));
    ordered.forEach((sight, k) => this.shots[k]!.put(sight, this.session.source.frame(sight.frame), () => this.zoom()));
    this.brighten();
    const has = ordered.some((s) => s.ring_px.length);
    this.tell(`${ordered.map((s) => `Frame ${s.frame} (${lightOf(s)}) at ${s.time_s.toFixed(2)} s`).join(", ")}; spot circled${has ? ", measured laser line dotted" : ""}.`);
  }

  /** Move the chosen place to the clicked one. */
  private async pick(sight: Sight, u: number, v: number): Promise<void> {
    try {
      this.session.moveTo(await this.session.source.spot(sight.frame, u, v));
    } catch (error) {
      this.tell(error instanceof Error ? error.message : String(error));
    }
  }
}

function lightOf({ illumination }: Sight): string { return illumination === "led" ? "lit" : illumination === "both" ? "lit, laser on" : illumination; }

/** One recorded frame. */
class Shot {
  readonly image = element("img", { alt: "" });
  private readonly marks = drawn("svg", { "aria-hidden": "true" });
  private readonly frame = element("div", { class: "zoomed", title: "a click moves the spot" }, this.image, this.marks);
  private readonly name = element("span", { class: "over name" });
  readonly root = element("div", { class: "picture" }, this.frame, this.name);
  private sight: Sight | null = null;

  constructor(picked: (sight: Sight, u: number, v: number) => void) {
    this.frame.addEventListener("click", (event) => {
      const matrix = (this.marks as SVGSVGElement).getScreenCTM();
      if (!this.sight || !matrix) return;
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
      picked(this.sight, at.x, at.y);
    });
  }

  /** Centre the chosen place, enlarged, or show the whole frame. */
  zoom(isClose: boolean): void {
    const box = this.root, [w, h] = [this.image.naturalWidth, this.image.naturalHeight];
    if (!this.sight || !w || !isClose) { this.frame.style.transform = ""; return; }
    const fit = Math.min(box.clientWidth / w, box.clientHeight / h);
    const close = Math.max(CLOSE, (CLOSE * box.clientHeight) / (h * fit) / 2); // half a picture beside another needs the same enlargement
    const [x, y] = [(this.sight.spot_px[0] - w / 2) * fit, (this.sight.spot_px[1] - h / 2) * fit];
    this.frame.style.transform = `scale(${close}) translate(${-x}px, ${-y}px)`;
  }

  put(sight: Sight, address: string, ready: () => void): void {
    this.sight = sight;
    const name = `${lightOf(sight)} frame ${sight.frame}`;
    if (this.image.getAttribute("src") !== address) this.name.textContent = `${name}, loading…`;
    this.image.onerror = () => { this.name.textContent = `${name} cannot be loaded`; };
    this.image.onload = () => {
      this.name.textContent = name;
      ready();
      this.marks.setAttribute("viewBox", `0 0 ${this.image.naturalWidth} ${this.image.naturalHeight}`);
      const [u, v] = sight.spot_px;
      this.marks.replaceChildren(
        ...sight.ring_px.filter((_, k) => k % 3 === 0).map(([x, y]) => drawn("circle", { cx: x, cy: y, r: 1.1, class: "ring" })),
        drawn("circle", { cx: u, cy: v, r: 26, class: "halo" }), drawn("circle", { cx: u, cy: v, r: 26, class: "spot" }),
      );
    };
    this.image.src = address;
    this.image.alt = `Recorded frame ${sight.frame}, ${lightOf(sight)}, the spot circled`;
  }
}
