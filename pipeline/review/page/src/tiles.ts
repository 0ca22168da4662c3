/** A layer of an unrolled wall, painted from tiles that are loaded as they are seen. */
import type { Source } from "./source";
import type { Layer, Point } from "./types";
import { TURN } from "./words";

const TILE = 512;
const MOST_TILES = 160;

/** The position of a wall on the screen: from its distances and azimuths to pixels. */
export interface Ground {
  x(distance: number): number;
  y(azimuth: number, distance: number): number;
  size: [number, number]; // pixels
  span: [number, number]; // visible distances of the wall
  mmPerPx: number;
}

export class TileLayer {
  layer: Layer | null = null;
  private readonly tiles = new Map<string, HTMLImageElement>();
  private wanted = "";
  private limits: Point | null = null;
  private shown = ""; // the layer whose levels are loaded

  constructor(private readonly source: Source, private readonly repaint: () => void) {}

  /** Show a layer, its colours between limits, mm, where they are given. */
  async load(name: string, limits: Point | null = null): Promise<void> {
    this.wanted = name;
    const layer = await this.source.layer(name);
    if (name !== this.wanted) return;
    this.layer = layer;
    this.limits = limits;
    this.shown = name;
    this.repaint();
  }

  paint(context: CanvasRenderingContext2D, ground: Ground): void {
    for (const turn of [-TURN, 0, TURN]) this.paintTurn(context, ground, turn);
  }

  private paintTurn(context: CanvasRenderingContext2D, ground: Ground, turn: number): void {
    const layer = this.layer;
    if (!layer) return;
    const mmPerPixel = (layer.distance_mm[1] - layer.distance_mm[0]) / layer.width;
    const level = Math.max(0, Math.min(layer.levels - 1, Math.floor(Math.log2(ground.mmPerPx / mmPerPixel))));
    const span = TILE << level;
    const column = (distance: number) => Math.floor((distance - layer.distance_mm[0]) / mmPerPixel / span);
    const [first, last] = [Math.max(0, column(ground.span[0])), Math.min(Math.ceil(layer.width / span) - 1, column(ground.span[1]))];
    const azimuth = (row: number) => layer.azimuth_rad + turn + (Math.min(row * span, layer.height) * TURN) / layer.height;
    context.imageSmoothingEnabled = ground.mmPerPx > mmPerPixel / 3;
    for (let k = first; k <= last; k++) {
      const from = layer.distance_mm[0] + k * span * mmPerPixel;
      const to = layer.distance_mm[0] + Math.min((k + 1) * span, layer.width) * mmPerPixel;
      for (let row = 0; row * span < layer.height; row++) {
        const [top, bottom] = [row, row + 1].map((r) => ground.y(azimuth(r), (from + to) / 2)) as [number, number];
        const image = bottom < 0 || top > ground.size[1] ? null : this.tile(level, k, row);
        if (image) context.drawImage(image, ground.x(from), top, ground.x(to) - ground.x(from) + 0.5, bottom - top + 0.5);
      }
    }
  }

  private tile(level: number, column: number, row: number): HTMLImageElement | null {
    const address = this.source.tile(this.shown, level, column, row, this.limits);
    const known = this.tiles.get(address);
    if (known) {
      this.tiles.delete(address);
      this.tiles.set(address, known); // the least recently used are dropped first
      return known.complete && known.naturalWidth ? known : null;
    }
    const image = new Image();
    image.onload = () => this.repaint();
    image.src = address;
    this.tiles.set(address, image);
    for (const old of this.tiles.keys()) {
      if (this.tiles.size <= MOST_TILES) break;
      this.tiles.delete(old);
    }
    return null;
  }
}
