/** Where the page gets its data: the local server, or the files of a read-only export. */
import type { Comparison, Layer, Point, Profile, Quality, Reading, ReviewState, Run, Seal, Section, Sight, Stand, Stretch, Tool } from "./types";

/** The server cannot be reached. */
export class LostError extends Error {}

export class RefusedError extends Error {
  constructor(message: string, readonly stale: boolean) { super(message); }
}

export interface Source {
  readonly readOnly: boolean;
  run(): Promise<Run>;
  state(): Promise<ReviewState>;
  seal(): Promise<Seal>;
  act(action: object, who: string, revision: number): Promise<ReviewState>;
  sign(name: string, standard: string, remarks: string, revision: number): Promise<ReviewState>;
  measure(tool: Tool, points: Point[]): Promise<Reading[]>;
  section(distance: number): Promise<Section>;
  profile(distance: number, azimuth: number, half: number): Promise<Profile>;
  sights(distance: number, azimuth: number): Promise<Sight[]>;
  layer(name: string): Promise<Layer>;
  /** The address of a tile; between limits (mm) where they are given and the server can be asked. */
  tile(layer: string, level: number, column: number, row: number, limits?: Point | null): string;
  frame(frame: number): string;
  /** The camera of a frame, turned to a place of the wall, and the frame as seen from there. */
  stand(frame: number, at: Point): Promise<Stand>;
  seenFrom(frame: number, at: Point, fov: number, width: number, height: number): string;
  spot(frame: number, u: number, v: number): Promise<Point>;
  stretches(): Promise<Stretch[]>;
  stretch(number: number): Promise<ArrayBuffer>;
  quality(): Promise<Quality>;
  comparison(): Promise<Comparison | null>;
}

async function answer<T>(response: Response): Promise<T> {
  if (response.ok) return (await response.json()) as T;
  const told = response.headers.get("content-type")?.includes("json")
    ? ((await response.json()) as { error: string }).error : await response.text();
  throw new RefusedError(told || response.statusText, response.status === 409);
}

async function reached(address: string, init?: RequestInit): Promise<Response> {
  try {
    return await fetch(address, init);
  } catch {
    throw new LostError("The server does not answer. Start it again: boresight review");
  }
}

const get = async <T>(address: string): Promise<T> => answer<T>(await reached(address));
const post = async <T>(address: string, body: object): Promise<T> =>
  answer<T>(await reached(address, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
  }));

export class Server implements Source {
  readonly readOnly = false;
  run = () => get<Run>("/api/run");
  state = () => get<ReviewState>("/api/state");
  seal = () => get<Seal>("/api/seal");
  act = (action: object, who: string, revision: number) => post<ReviewState>("/api/actions", { action, who, revision });
  sign = (name: string, standard: string, remarks: string, revision: number) =>
    post<ReviewState>("/api/sign", { name, standard, remarks, revision });
  measure = async (tool: Tool, points: Point[]) =>
    (await post<{ readings: Reading[] }>("/api/measure", { tool, points })).readings;
  section = (distance: number) => get<Section>(`/api/section?distance=${distance}`);
  profile = (distance: number, azimuth: number, half: number) =>
    get<Profile>(`/api/profile?distance=${distance}&azimuth=${azimuth}&half=${half}`);
  sights = async (distance: number, azimuth: number) =>
    (await get<{ sights: Sight[] }>(`/api/sights?distance=${distance}&azimuth=${azimuth}`)).sights;
  // Wall loss is deviation in other colours: the server has an address for it only between limits.
  layer = (name: string) => get<Layer>(`/api/tiles/${name}${name.endsWith("wall_loss") ? "?low=0&high=1" : ""}`);
  tile = (layer: string, level: number, column: number, row: number, limits?: Point | null) =>
    `/api/tiles/${layer}/${level}/${column}/${row}.png${limits ? `?low=${limits[0]}&high=${limits[1]}` : ""}`;
  frame = (frame: number) => `/api/frames/${frame}.jpg`;
  stand = (frame: number, [distance, azimuth]: Point) => get<Stand>(`/api/frames/${frame}/stand?distance=${distance}&azimuth=${azimuth}`);
  seenFrom = (frame: number, [distance, azimuth]: Point, fov: number, width: number, height: number) =>
    `/api/frames/${frame}/seen.png?distance=${distance}&azimuth=${azimuth}&fov=${fov}&width=${width}&height=${height}`;
  spot = async (frame: number, u: number, v: number) =>
    (await get<{ point: Point }>(`/api/frames/${frame}/spot?u=${u}&v=${v}`)).point;
  stretches = () => get<Stretch[]>("/api/model");
  stretch = async (number: number) => {
    const response = await reached(`/api/model/${number}.glb`);
    if (!response.ok) throw new RefusedError("The model cannot be read.", false);
    return response.arrayBuffer();
  };
  quality = () => get<Quality>("/api/quality");
  comparison = () => get<Comparison | null>("/api/comparison");
}

/** Data that an export puts beside the page as a script, because a page opened from a file may not fetch. */
export interface Exported {
  run: Run; state: ReviewState; seal: Seal; quality: Quality; comparison?: Comparison; sections: Section[]; layers: Record<string, Layer>; model: { stretches: Stretch[]; parts: string[] };
  spots: { distance_mm: number; azimuth_rad: number; sights: Sight[]; profile: Profile }[];
}

export class Export implements Source {
  readonly readOnly = true;
  constructor(private readonly data: Exported) {}
  run = async () => this.data.run;
  state = async () => this.data.state;
  seal = async () => this.data.seal;
  act = async (): Promise<ReviewState> => { throw new RefusedError("This copy is read-only.", false); };
  sign = this.act;
  measure = async (): Promise<Reading[]> => { throw new RefusedError("Measuring needs boresight review.", false); };
  section = async (distance: number) =>
    this.data.sections.reduce((a, b) =>
      Math.abs(b.distance_mm - distance) < Math.abs(a.distance_mm - distance) ? b : a);
  private near(distance: number, azimuth: number) {
    const away = (s: { distance_mm: number; azimuth_rad: number }) =>
      Math.hypot(s.distance_mm - distance, 50 * Math.sin((s.azimuth_rad - azimuth) / 2));
    const found = [...this.data.spots].sort((a, b) => away(a) - away(b))[0];
    if (!found || away(found) > 8) throw new RefusedError("This copy shows frames of findings only.", false);
    return found;
  }
  profile = async (distance: number, azimuth: number) => this.near(distance, azimuth).profile;
  sights = async (distance: number, azimuth: number) => this.near(distance, azimuth).sights;
  layer = async (name: string) => this.data.layers[name]!;
  tile = (layer: string, level: number, column: number, row: number) => `tiles/${layer}/${level}/${column}/${row}.png`;
  frame = (frame: number) => `frames/${frame}.jpg`;
  spot = async (): Promise<Point> => { throw new RefusedError("Choosing a place in a frame needs boresight review.", false); };
  stand = async (): Promise<Stand> => { throw new RefusedError("Showing frame and model in the same view needs boresight review.", false); };
  seenFrom = (frame: number) => this.frame(frame);
  quality = async () => this.data.quality;
  comparison = async () => this.data.comparison ?? null;
  stretches = async () => this.data.model.stretches;
  stretch = async (number: number) => Uint8Array.from(atob(this.data.model.parts[number]!), (c) => c.charCodeAt(0)).buffer;
}
