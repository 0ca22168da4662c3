/** What the page shows at present, and the listeners that are notified of changes. */
import { LostError, RefusedError, type Source } from "./source";
import type { Finding, Overlay, Point, ReviewState, Run, SavedReading, Seal, Stand, Tool } from "./types";
import { azimuthOf, wrapped } from "./words";

// Least value of a layer's end colours: about the depth from which findings are reported.
const [LEAST_RANGE_MM, LEAST_SIGMA_MM] = [0.25, 0.05];

export type Topic = "limits" | "readings" | "state" | "seal" | "selection" | "cursor" | "layer" | "tool" | "message" | "shape" | "reject" | "nameless" | "named" | "recomputed" | "stand";

export class Session {
  selected: string | null = null;
  marked = new Set<string>();
  cursor: Point;
  layer = "photo";
  tool: Tool = "none";
  drawn: Point[] = [];
  message = "";
  /** The recorded frame in whose view the model is shown; null for a free view. */
  stand: Stand | null = null;
  private isGiven = false; // whether the drawn shape is the finding's own outline, not changed yet
  /** Null while the server still reads the files that a signature covers. */
  seal: Seal | null = null;
  /** The measurements made in this browser on this run, newest last. */
  readings: SavedReading[] = [];
  private readonly fixed = new Map<string, Point>();
  private isLost = false;
  private isAsking = false;
  private readonly listeners = new Map<Topic, (() => void)[]>();

  constructor(readonly source: Source, readonly run: Run, public state: ReviewState) {
    this.readings = JSON.parse(localStorage.getItem(`boresight-readings-${run.version}`) ?? "[]") as SavedReading[];
    this.cursor = [(run.distance_mm[0] + run.distance_mm[1]) / 2, -Math.PI / 2];
  }

  on(topics: Topic[], listener: () => void): void {
    for (const topic of topics) this.listeners.set(topic, [...(this.listeners.get(topic) ?? []), listener]);
  }

  tell(topic: Topic): void {
    for (const listener of this.listeners.get(topic) ?? []) listener();
  }

  get who(): string { return localStorage.getItem("boresight-who") ?? ""; }
  set who(name: string) { localStorage.setItem("boresight-who", name); this.tell("named"); }

  get standing(): Finding[] { return this.state.findings.filter((f) => f.status !== "gone"); }
  get finding(): Finding | null { return this.standing.find((f) => f.id === this.selected) ?? null; }

  select(id: string | null): void {
    this.selected = id;
    const found = this.finding;
    if (found) this.moveTo(peakOf(found));
    this.tell("selection");
  }

  moveTo([distance, azimuth]: Point): void {
    const [from, to] = this.run.distance_mm;
    this.cursor = [Math.min(Math.max(distance, from), to), wrapped(azimuth)];
    this.tell("cursor");
  }

  standAs(stand: Stand | null): void {
    if (stand === this.stand) return;
    this.stand = stand;
    this.tell("stand");
  }

  show(layer: string): void { this.layer = layer; this.tell("layer"); }

  /** The number that people see for a finding; the ids of the ledger are internal. */
  called(id: string): string { return this.state.findings.find((f) => f.id === id)?.label ?? id; }

  overlay(layer = this.layer): Overlay | null { return this.run.overlays.find((o) => o.name === layer) ?? null; }

  /** The range of values, mm, of a layer's colours: fixed by the user, else the full range; null for the photo. */
  limits(layer = this.layer): Point | null {
    const overlay = this.overlay(layer);
    if (!overlay) return null;
    if (this.source.readOnly || !overlay.full_mm) return [overlay.low_mm, overlay.high_mm];
    return this.fixed.get(layer) ?? wholeRange(overlay);
  }

  isFixed(layer = this.layer): boolean { return this.fixed.has(layer); }

  /** Fix the range of values, mm, of a layer's colours; null: its full range. */
  fix(limits: Point | null, layer = this.layer): void {
    if (limits) this.fixed.set(layer, limits); else this.fixed.delete(layer);
    this.tell("limits");
  }

  keep(reading: SavedReading): void { this.store([...this.readings, reading]); }
  forget(): void { this.store([]); }

  private store(readings: SavedReading[]): void {
    this.readings = readings;
    localStorage.setItem(`boresight-readings-${this.run.version}`, JSON.stringify(readings));
    this.tell("readings");
  }

  take(tool: Tool): void {
    this.tool = tool;
    this.drawn = tool === "redraw" && this.finding ? [...this.finding.outline] : [];
    this.isGiven = this.drawn.length > 0;
    this.tell("tool");
    this.tell("shape");
  }

  /** Add a point; if the drawn shape is a finding's own outline, the point begins a new outline. */
  draw(at: Point): void {
    this.drawn = this.isGiven ? [at] : [...this.drawn, at];
    this.isGiven = false;
    this.tell("shape");
  }

  /** Move a drawn point. */
  replace(corner: number, at: Point): void { this.drawn = this.drawn.map((p, k) => (k === corner ? at : p)); this.isGiven = false; this.tell("shape"); }

  /** The azimuth, with whole turns added, that is nearest to the last drawn point. */
  beside(azimuth: number): number {
    const last = this.drawn[this.drawn.length - 1];
    return last ? last[1] + wrapped(azimuth - last[1]) : azimuth;
  }

  /** Ask why the chosen finding is not a defect. */
  askToReject(): void { if (this.finding) this.tell("reject"); }

  say(message: string): void { this.message = message; this.tell("message"); }

  async act(action: object): Promise<boolean> {
    if (!this.who) {
      this.say("Give your name first: it is kept with every decision.");
      this.tell("nameless");
      return false;
    }
    return this.change(() => this.source.act(action, this.who, this.state.revision));
  }

  async sign(name: string, standard: string, remarks: string): Promise<boolean> {
    return this.change(() => this.source.sign(name, standard, remarks, this.state.revision));
  }

  /** Check whether anything has changed, here or elsewhere. */
  async refresh(): Promise<void> {
    if (this.isAsking) return;
    this.isAsking = true;
    try {
      let seal = await this.source.seal();
      while (seal.revision < this.state.revision) seal = await this.source.seal(); // requested before the last action
      if (this.isLost) { this.isLost = false; this.say(""); }
      if (seal.run_version !== this.run.version) this.tell("recomputed");
      const isNews = seal.revision !== this.state.revision || (this.seal !== null && seal.sha256 !== this.seal.sha256);
      if (isNews) this.put(await this.source.state());
      const isSeen = !isNews && this.seal?.sha256 === seal.sha256 && this.seal.signature?.id === seal.signature?.id;
      this.seal = seal;
      if (!isSeen) this.tell("seal");
    } finally { this.isAsking = false; }
  }

  /** The server does not answer, or the run cannot be read at present: shown until it can. */
  lose(error: Error): void { this.isLost = true; this.say(error.message); }

  private async change(work: () => Promise<ReviewState>): Promise<boolean> {
    try {
      this.seal = null;
      this.put(await work());
      this.say("");
      void this.refresh().catch((e: Error) => this.lose(e));
      return true;
    } catch (error) {
      if (error instanceof RefusedError && error.stale) this.put(await this.source.state());
      // When the server answers again before the next check, the message about it is removed.
      if (error instanceof LostError) this.lose(error);
      else this.say(error instanceof Error ? error.message : String(error));
      return false;
    }
  }

  /** The findings that a removed finding has become, or was made of. */
  private heir(gone: Finding): string | null {
    return this.standing.find((f) => f.made_of.includes(gone.id) || gone.made_of.includes(f.id))?.id ?? null;
  }

  private put(state: ReviewState): void {
    const before = this.finding;
    this.state = state;
    if (before && !this.finding) this.selected = this.heir(before);
    this.marked = new Set([...this.marked].filter((id) => this.standing.some((f) => f.id === id)));
    this.tell("state");
    this.tell("selection");
  }
}

/** The place where a finding is deepest, or highest; its middle where that is not known. */
export function peakOf({ outline, size }: Finding): Point {
  const [distance, azimuth] = middle(outline);
  const { peak_distance_mm: peak, peak_clock: hours } = size;
  return [peak ?? distance, hours === null || hours === undefined ? azimuth : azimuth + wrapped(azimuthOf(hours) - azimuth)];
}

/** The full range of a layer; signed values get a symmetric range, wide enough that noise has no alarming colours. */
export function wholeRange({ name, low_mm, high_mm, full_mm }: Overlay): Point {
  const [low, high] = full_mm ?? [low_mm, high_mm];
  if (low_mm >= 0) return [0, Math.max(high, name === "uncertainty" ? LEAST_SIGMA_MM : LEAST_RANGE_MM)];
  const reach = Math.max(-low, high, LEAST_RANGE_MM);
  return [-reach, reach];
}

export function middle(outline: Point[]): Point {
  const sum = outline.reduce((a, p) => [a[0] + p[0], a[1] + p[1]] as Point, [0, 0] as Point);
  return [sum[0] / outline.length, sum[1] / outline.length];
}

/** Most severe first: cracks, metal loss, dents, deposits, welds, and within each the deepest. */
export function bySeverity(findings: Finding[]): Finding[] {
  const rank: Record<string, number> = { crack: 0, pit: 1, corrosion: 1, gouge: 1, dent: 2, deposit: 3, weld: 4 };
  return [...findings].sort((a, b) =>
    (rank[a.kind] ?? 9) - (rank[b.kind] ?? 9) || Math.abs(b.size.depth_mm ?? 0) - Math.abs(a.size.depth_mm ?? 0));
}
