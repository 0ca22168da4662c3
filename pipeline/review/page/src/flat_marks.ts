/** Marks on the unrolled wall: clock and distances, findings with their numbers, the chosen place, and shapes being drawn. */
import type { Session } from "./session";
import type { Finding, Point } from "./types";
import { CHOSEN_COLOUR, TURN, clock } from "./words";

const TOP = -1.5 * Math.PI; // 6 o'clock
// Outlines must be visible on pictures of any colour, in light and dark mode: bright with a black border.
const [CASING, OUTLINE, CHOSEN] = ["#000000", "#ffffff", CHOSEN_COLOUR];
const MARKS: Record<string, string> = { open: "?", accepted: "✓", rejected: "✕" };

/** The position of the wall on the screen, in pixels. */
export interface Plane {
  x(distance: number): number;
  y(azimuth: number): number;
  point(x: number, y: number): Point;
  readonly size: [number, number];
  readonly mmPerPx: number;
}

export class FlatMarks {
  constructor(private readonly context: CanvasRenderingContext2D, private readonly session: Session, private readonly plane: Plane, private readonly style: CSSStyleDeclaration) {}

  paint(): void {
    this.paintGrid();
    for (const turn of [-TURN, 0, TURN]) this.paintFindings(turn);
    this.paintCursor();
    this.paintShape();
  }

  private get textPx(): number { return 0.9 * parseFloat(this.style.fontSize); }

  private paintGrid(): void {
    const [width, height] = this.plane.size;
    this.context.font = `${this.textPx}px system-ui, sans-serif`;
    this.context.textBaseline = "middle";
    for (let hour = -12; hour < 24; hour += 3) {
      const azimuth = TOP + (hour * Math.PI) / 6;
      this.label(clock(azimuth).replace(":00", " h"), 4, this.plane.y(azimuth), "left");
    }
    const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000].find((s) => s / this.plane.mmPerPx > 7 * this.textPx) ?? 20000;
    for (let s = Math.ceil(this.plane.point(0, 0)[0] / step) * step; s < this.plane.point(width, 0)[0]; s += step) {
      this.label(`${s} mm`, this.plane.x(s), height - this.textPx, "center");
    }
  }

  private label(text: string, x: number, y: number, align: CanvasTextAlign): void {
    this.context.textAlign = align;
    this.context.lineWidth = 3;
    this.context.strokeStyle = this.style.getPropertyValue("--halo");
    this.context.fillStyle = this.style.getPropertyValue("--ink");
    this.context.strokeText(text, x, y);
    this.context.fillText(text, x, y);
  }

  private paintFindings(turn: number): void {
    const [left, right] = [this.plane.point(0, 0)[0], this.plane.point(this.plane.size[0], 0)[0]];
    for (const finding of this.session.standing) {
      if (finding.size.distance_to_mm < left || finding.size.distance_from_mm > right) continue;
      const chosen = finding.id === this.session.selected;
      this.context.setLineDash(finding.status === "rejected" ? [4, 4] : []);
      this.trace(finding.outline.map(([s, a]) => [s, a + turn] as Point), true);
      this.cased(chosen ? CHOSEN : OUTLINE, chosen ? 2.6 : 1.8);
      this.context.setLineDash([]);
      this.name(finding, turn, chosen);
    }
  }

  /** Number and decision at the outline's upper right corner. */
  private name(finding: Finding, turn: number, chosen: boolean): void {
    const x = this.plane.x(Math.max(...finding.outline.map((p) => p[0]))) + 4;
    const y = this.plane.y(Math.min(...finding.outline.map((p) => p[1])) + turn);
    this.context.font = `bold ${this.textPx}px system-ui, sans-serif`;
    this.context.textAlign = "left";
    this.context.lineWidth = 4;
    this.context.strokeStyle = CASING;
    this.context.fillStyle = chosen ? CHOSEN : OUTLINE;
    const text = `${finding.label.split(" ")[0]} ${MARKS[finding.status] ?? ""}`;
    this.context.strokeText(text, x, y);
    this.context.fillText(text, x, y);
  }

  private cased(colour: string, width: number): void {
    this.context.lineWidth = width + 2.4;
    this.context.strokeStyle = CASING;
    this.context.stroke();
    this.context.lineWidth = width;
    this.context.strokeStyle = colour;
    this.context.stroke();
  }

  private paintCursor(): void {
    const [s, a] = this.session.cursor;
    const x = Math.round(this.plane.x(s)) + 0.5;
    this.context.beginPath();
    this.context.moveTo(x, 0);
    this.context.lineTo(x, this.plane.size[1]);
    for (const turn of [-TURN, 0, TURN]) {
      const y = Math.round(this.plane.y(a + turn)) + 0.5;
      this.context.moveTo(x - 14, y);
      this.context.lineTo(x + 14, y);
    }
    this.cased(CHOSEN, 1);
  }

  private paintShape(): void {
    const { drawn: points, tool } = this.session;
    if (!points.length) return;
    this.trace(points, !["distance", "point", "diameter"].includes(tool));
    this.cased(CHOSEN, 2);
    for (const [s, a] of points) {
      this.context.fillStyle = CASING;
      this.context.fillRect(this.plane.x(s) - 4, this.plane.y(a) - 4, 8, 8);
      this.context.fillStyle = CHOSEN;
      this.context.fillRect(this.plane.x(s) - 3, this.plane.y(a) - 3, 6, 6);
    }
  }

  private trace(points: Point[], closed: boolean): void {
    this.context.beginPath();
    points.forEach(([s, a], k) => (k ? this.context.lineTo(this.plane.x(s), this.plane.y(a)) : this.context.moveTo(this.plane.x(s), this.plane.y(a))));
    if (closed) this.context.closePath();
  }
}
