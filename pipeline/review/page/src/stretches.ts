/** The detailed model in stretches: those near the camera are loaded, distant ones are removed. */
import * as THREE from "three";
import { GLTFLoader, type GLTF } from "three/examples/jsm/loaders/GLTFLoader.js";
import type { Lamp } from "./lamp";
import { byPlace, placesOf, Strip } from "./painted";
import type { Pipe } from "./pipe";
import type { Session } from "./session";
import { thinned } from "./thinned";
import type { Point, Stretch } from "./types";

const MM = 1e-3;
const PHOTO = "photo";
/** As recorded, uniformly lit; with raking light on its relief; or in the light of a recorded frame. */
export type Light = "even" | "raking" | "frame";
// The variants of model.glb, for an exported copy, which may not give its pictures to WebGL.
const VARIANTS: Record<string, string> = { deviation_nominal: "deviation" };
const ANISOTROPY = 8;
// Limits that a browser without a graphics card can still draw, and that keep the tab's memory small.
const MOST_TRIANGLES = 215_000;
const AT_ONCE = 2;
// While the view moves without a graphics card, vertices are joined in cells of this many radii along and around: a twentieth
// of the triangles remains, and between them a round wall is off by 0.2 % of its radius.
const THINNED_RADII = 0.12;

interface Part {
  mesh: THREE.Mesh; base: Float32Array; away: Float32Array; variants: Map<string, THREE.Material>; at: Float64Array; span: Point;
  painted: { strip: Strip; material: THREE.Material } | null; wanted: string; all: number; lights: Record<Light, THREE.Material>;
}

export class Stretches {
  readonly group = new THREE.Group();
  private list: Stretch[] = [];
  private readonly held = new Map<number, Part[]>();
  private readonly coming = new Set<number>();
  private at = 0;
  private gain = 1;
  private light: Light = "even";
  private isThin = false;

  constructor(private readonly session: Session, private readonly pipe: Pipe, private readonly lamp: Lamp, private readonly isPlain: boolean, private readonly changed: () => void) {}

  async start(): Promise<void> { this.list = await this.session.source.stretches(); }

  get parts(): Part[] { return [...this.held.values()].flat(); }
  get meshes(): THREE.Mesh[] { return this.parts.map((p) => p.mesh); }
  get isAll(): boolean { return this.wanted().length === this.list.length; }
  get isReady(): boolean { return this.list.length > 0 && this.wanted().every((k) => this.held.has(k)); }

  /** The distances between which all detail is loaded. */
  get span(): [number, number] | null {
    const there = [...this.held.keys()].sort((a, b) => a - b).map((k) => this.list[k]!);
    return there.length ? [there[0]!.from_mm, there[there.length - 1]!.to_mm] : null;
  }

  /** Load the stretches near a distance, nearest first. */
  async around(distance: number): Promise<void> {
    this.at = distance;
    const wanted = this.wanted();
    for (const k of [...this.held.keys()]) if (!wanted.includes(k)) this.drop(k);
    const next = wanted.filter((k) => !this.held.has(k) && !this.coming.has(k)).slice(0, AT_ONCE - this.coming.size);
    if (next.length) await Promise.all(next.map((k) => this.load(k)));
  }

  /** Show the chosen layer: the photo in a light, or error colours. */
  dress(light = this.light): void {
    this.light = light;
    for (const part of this.parts) this.wear(part);
  }

  /** Draw fewer triangles while a browser without a graphics card moves the view, or all of them. */
  thin(isThin: boolean): void {
    this.isThin = isThin && this.isPlain;
    for (const part of this.parts) this.range(part);
  }

  private range({ mesh: { geometry }, all }: Part): void {
    if (this.isThin) geometry.setDrawRange(all, geometry.index!.count - all); else geometry.setDrawRange(0, all);
  }

  private wear(part: Part): void {
    const { session } = this, { mesh, variants, lights } = part;
    const isPhoto = session.layer === PHOTO;
    part.wanted = isPhoto ? PHOTO : `${session.layer} ${session.limits()!.join(" ")}`;
    if (isPhoto) mesh.material = lights[this.light];
    else if (session.source.readOnly) mesh.material = variants.get(VARIANTS[session.layer] ?? session.layer) ?? lights.even;
    else if (part.painted?.material.name === part.wanted) mesh.material = part.painted.material;
    else void this.paint(part, part.wanted).catch((e: Error) => session.say(e.message));
  }

  /** Colour a part with the flat view's tiles; a newer request is not overwritten by an older one. */
  private async paint(part: Part, name: string): Promise<void> {
    const strip = await Strip.load(this.session, this.session.layer, part.span, this.isPlain);
    if (part.wanted !== name) { strip.dispose(); return; }
    const old = part.painted;
    const material = byPlace(strip.texture, name);
    material.clippingPlanes = [];
    part.mesh.geometry.setAttribute("place", placesOf(part.at, part.span, strip.azimuth));
    part.painted = { strip, material };
    part.mesh.material = material;
    old?.strip.dispose();
    old?.material.dispose();
    this.changed();
  }

  exaggerate(gain: number): void {
    this.gain = gain;
    for (const part of this.parts) shape(part, gain);
  }

  clip(planes: THREE.Plane[]): void {
    for (const { mesh } of this.parts) (mesh.material as THREE.Material).clippingPlanes = planes;
  }

  /** The stretches to be loaded, nearest first; since they are in order, the search goes from the nearest outward. */
  private wanted(): number[] {
    const ahead = this.at + this.session.run.radius_mm, { list } = this, out: number[] = [];
    const off = (k: number) => { const s = list[k]; return s ? Math.max(s.from_mm - ahead, ahead - s.to_mm, 0) : Infinity; };
    let [low, high] = [0, list.length]; // the first one that begins beyond
    while (low < high) { const middle = (low + high) >> 1; if (list[middle]!.from_mm > ahead) high = middle; else low = middle + 1; }
    for (let [before, after, sum] = [low - 1, low, 0]; out.length < list.length;) {
      const k = off(before) <= off(after) ? before-- : after++;
      if ((sum += list[k]!.triangles) > MOST_TRIANGLES && out.length) break;
      out.push(k);
    }
    return out;
  }

  private async load(k: number): Promise<void> {
    this.coming.add(k);
    try {
      const gltf = await new GLTFLoader().parseAsync(await this.session.source.stretch(k), "");
      const parts = await this.taken(gltf);
      if (!this.wanted().includes(k)) parts.forEach(free);
      else {
        this.held.set(k, parts);
        this.group.add(gltf.scene);
        this.group.updateMatrixWorld(true);
        this.dress();
      }
    } finally { this.coming.delete(k); }
    this.changed();
    await this.around(this.at);
  }

  private drop(k: number): void {
    for (const part of this.held.get(k)!) {
      part.mesh.parent?.removeFromParent();
      free(part);
    }
    this.held.delete(k);
    this.changed();
  }

  private async taken(gltf: GLTF): Promise<Part[]> {
    const names: string[] = ((gltf.userData["gltfExtensions"] as Record<string, { variants?: { name: string }[] }> | undefined)
      ?.["KHR_materials_variants"]?.variants ?? []).map((v) => v.name);
    const meshes: THREE.Mesh[] = [];
    gltf.scene.traverse((node) => { if (node instanceof THREE.Mesh) meshes.push(node as THREE.Mesh); });
    return Promise.all(meshes.map((mesh) => this.part(mesh, gltf, names)));
  }

  private async part(mesh: THREE.Mesh, gltf: GLTF, names: string[]): Promise<Part> {
    const variants = new Map<string, THREE.Material>([["photo", mesh.material as THREE.Material]]);
    const extension = mesh.userData["gltfExtensions"]?.["KHR_materials_variants"] as
      { mappings: { material: number; variants: number[] }[] } | undefined;
    for (const mapping of extension?.mappings ?? []) {
      const material = (await gltf.parser.getDependency("material", mapping.material)) as THREE.Material;
      gltf.parser.assignFinalMaterial(mesh);
      for (const k of mapping.variants) variants.set(names[k] ?? "", material);
    }
    const { map: picture, name: title } = variants.get(PHOTO) as THREE.MeshStandardMaterial;
    variants.get(PHOTO)!.dispose();
    variants.delete(PHOTO);
    if (picture) picture.anisotropy = this.isPlain ? 1 : ANISOTROPY;
    // The photo contains the light of the probe: no other light is added unless relief is to be seen.
    const lights = {
      even: new THREE.MeshBasicMaterial({ map: picture, name: title }),
      raking: new THREE.MeshLambertMaterial({ map: picture, name: `${title}, raking light` }),
      frame: this.lamp.material(picture, `${title}, light of the frame`),
    };
    for (const material of [...variants.values(), ...Object.values(lights)]) {
      const { map } = material as THREE.MeshBasicMaterial;
      // Colours are not converted, and one mipmap level is enough: both are slow without a graphics card.
      if (map && this.isPlain) [map.colorSpace, map.minFilter] = [THREE.NoColorSpace, THREE.LinearMipmapNearestFilter];
      material.side = THREE.DoubleSide;
      material.clippingPlanes = [];
    }
    const base = Float32Array.from((mesh.geometry.getAttribute("position") as THREE.BufferAttribute).array);
    // Vertices are stored in the pipe's frame; only the node above rotates them.
    const { at, away } = this.pipe.locate(base, MM, this.session.run.radius_mm);
    const part: Part = { mesh, variants, lights, painted: null, wanted: "", at, span: spanOf(at), all: mesh.geometry.index!.count, away, base };
    if (this.isPlain) this.addThinned(part);
    if (this.gain !== 1) shape(part, this.gain);
    return part;
  }

  /** Append the decimated triangles of a part to its own. */
  private addThinned(part: Part): void {
    const { geometry } = part.mesh, whole = geometry.index!.array, { radius_mm: radius } = this.session.run;
    const few = thinned(whole, part.at, [THINNED_RADII * radius, THINNED_RADII]);
    const both = new Uint32Array(whole.length + few.length);
    both.set(whole);
    both.set(few, whole.length);
    geometry.setIndex(new THREE.BufferAttribute(both, 1));
    this.range(part);
  }
}

function spanOf(at: Float64Array): Point {
  let [low, high] = [Infinity, -Infinity];
  for (let k = 0; k < at.length; k += 2) { low = Math.min(low, at[k]!); high = Math.max(high, at[k]!); }
  return [low, high];
}

function shape({ mesh, base, away }: Part, gain: number): void {
  const position = mesh.geometry.getAttribute("position") as THREE.BufferAttribute;
  const array = position.array as Float32Array;
  for (let k = 0; k < array.length; k++) array[k] = base[k]! + (gain - 1) * away[k]!;
  position.needsUpdate = true;
}

function free({ mesh, variants, lights, painted }: Part): void {
  mesh.geometry.dispose();
  painted?.strip.dispose();
  painted?.material.dispose();
  for (const material of [...Object.values(lights), ...new Set(variants.values())]) {
    const map = (material as THREE.MeshStandardMaterial).map;
    map?.dispose();
    (map?.source.data as ImageBitmap | undefined)?.close?.();
    material.dispose();
  }
}
