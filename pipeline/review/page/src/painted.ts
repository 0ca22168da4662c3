/** Error colours on the model, made of the flat view's own tiles, so that both have the same colours and limits. */
import * as THREE from "three";
import type { Session } from "./session";
import type { Layer, Point } from "./types";

const TILE = 512;
const MOST_PX = 2048;
const NOT_SEEN = "#808080";

/** A matt material that shows a picture by distance and azimuth: attribute `place` is (cos, sin, share of the picture). */
export function byPlace(map: THREE.Texture, name: string): THREE.MeshBasicMaterial {
  const material = new THREE.MeshBasicMaterial({ map, name, side: THREE.DoubleSide });
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader.replace("#include <common>", "#include <common>\nattribute vec3 place; varying vec3 vPlace;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvPlace = place;");
    shader.fragmentShader = shader.fragmentShader.replace("#include <common>", "#include <common>\nvarying vec3 vPlace;")
      .replace("#include <map_fragment>", "diffuseColor *= texture2D(map, vec2(vPlace.z, 1.0 - fract(atan(vPlace.y, vPlace.x) / 6.283185307179586)));");
  };
  return material;
}

/** The wall between two distances as a picture: distance to the right, azimuth downward from that of the layer's first row. */
export class Strip {
  readonly texture: THREE.CanvasTexture;

  private constructor(canvas: HTMLCanvasElement, readonly azimuth: number, isPlain: boolean) {
    this.texture = new THREE.CanvasTexture(canvas);
    this.texture.generateMipmaps = false; // where the texture closes around the pipe, a smaller mipmap level would show a seam
    this.texture.minFilter = THREE.LinearFilter;
    this.texture.wrapT = THREE.RepeatWrapping;
    this.texture.colorSpace = isPlain ? THREE.NoColorSpace : THREE.SRGBColorSpace;
  }

  static async load(session: Session, name: string, [from, to]: Point, isPlain: boolean): Promise<Strip> {
    const layer = await session.source.layer(name), limits = session.limits(name);
    const perMm = layer.width / (layer.distance_mm[1] - layer.distance_mm[0]);
    const level = levelOf(layer, (to - from) * perMm);
    const [first, width] = [((from - layer.distance_mm[0]) * perMm) / 2 ** level, ((to - from) * perMm) / 2 ** level];
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [Math.max(1, Math.round(width)), Math.max(1, layer.height >> level)];
    const context = canvas.getContext("2d")!;
    context.fillStyle = NOT_SEEN;
    context.fillRect(0, 0, canvas.width, canvas.height);
    const [start, end] = [Math.max(0, Math.floor(first / TILE)), Math.min(Math.ceil(layer.width / (TILE << level)), Math.ceil((first + width) / TILE))];
    const tiles: Promise<void>[] = [];
    for (let column = start; column < end; column++) {
      for (let row = 0; row * TILE < canvas.height; row++) {
        const address = session.source.tile(name, level, column, row, limits);
        tiles.push(picture(address).then((image) => { context.drawImage(image, column * TILE - first, row * TILE); }));
      }
    }
    await Promise.all(tiles);
    return new Strip(canvas, layer.azimuth_rad, isPlain);
  }

  dispose(): void { this.texture.dispose(); }
}

function levelOf(layer: Layer, width: number): number {
  let level = 0;
  while (level < layer.levels - 1 && Math.max(width, layer.height) / 2 ** level > MOST_PX) level++;
  return level;
}

async function picture(address: string): Promise<HTMLImageElement> {
  const image = new Image();
  image.src = address;
  await image.decode();
  return image;
}

/** The vertex attribute for `byPlace`: from distances and azimuths in turn, those of the picture's edges. */
export function placesOf(at: Float64Array, [from, to]: Point, azimuth: number): THREE.Float32BufferAttribute {
  const out = new Float32Array((3 * at.length) / 2);
  for (let k = 0; 2 * k < at.length; k++) {
    const a = at[2 * k + 1]! - azimuth;
    out[3 * k] = Math.cos(a); out[3 * k + 1] = Math.sin(a); out[3 * k + 2] = (at[2 * k]! - from) / (to - from);
  }
  return new THREE.Float32BufferAttribute(out, 3);
}

