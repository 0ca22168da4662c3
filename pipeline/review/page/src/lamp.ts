/** The photo in the light of a recorded frame: uniformly lit wall times the lamps' brightness there. */
import * as THREE from "three";
import { toModel } from "./graphics";
import type { Stand } from "./types";

const MM = 1e-3;
const VERTEX = "uniform vec3 lampEye; varying vec3 vFromLamp;";
const FRAGMENT = "uniform mat3 lampAxes; uniform sampler2D lampLight; uniform vec2 lampPolar; varying vec3 vFromLamp;";

export class Lamp {
  private readonly uniforms = {
    lampEye: { value: new THREE.Vector3() }, lampAxes: { value: new THREE.Matrix3() },
    lampPolar: { value: new THREE.Vector2(0, 1) }, lampLight: { value: table([[1]]) },
  };

  constructor(private readonly isPlain: boolean) {}

  /** Use the position and the light of a frame. */
  take({ eye_p, R_pc, polar_rad, light }: Stand): void {
    this.uniforms.lampEye.value.copy(toModel(eye_p).multiplyScalar(MM));
    const [x, y, z] = [0, 1, 2].map((k) => toModel([R_pc[0]![k]!, R_pc[1]![k]!, R_pc[2]![k]!])) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
    this.uniforms.lampAxes.value.set(x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z);
    // Rows are at the middles of the picture's pixels.
    const half = (polar_rad[1] - polar_rad[0]) / (light.length - 1) / 2;
    this.uniforms.lampPolar.value.set(polar_rad[0] - half, polar_rad[1] + half);
    this.uniforms.lampLight.value.dispose();
    this.uniforms.lampLight.value = table(light);
  }

  material(map: THREE.Texture | null, name: string): THREE.MeshBasicMaterial {
    const material = new THREE.MeshBasicMaterial({ map, name });
    // Grey levels are proportional to light; where three.js has converted them to another scale, they are converted back.
    const [to, back] = this.isPlain ? ["", ""] : ["sRGBTransferOETF", "sRGBTransferEOTF"];
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms);
      shader.vertexShader = shader.vertexShader.replace("#include <common>", `#include <common>\n${VERTEX}`)
        .replace("#include <project_vertex>", "#include <project_vertex>\nvFromLamp = (modelMatrix * vec4(transformed, 1.0)).xyz - lampEye;");
      shader.fragmentShader = shader.fragmentShader.replace("#include <common>", `#include <common>\n${FRAGMENT}`)
        .replace("#include <map_fragment>", `#include <map_fragment>
vec3 inCamera = lampAxes * normalize(vFromLamp);
vec2 atLamp = vec2(atan(inCamera.y, inCamera.x) / 6.283185307179586 + 0.5, (acos(clamp(inCamera.z, -1.0, 1.0)) - lampPolar.x) / (lampPolar.y - lampPolar.x));
diffuseColor = ${back}(vec4(${to}(diffuseColor).rgb * texture2D(lampLight, atLamp).r, diffuseColor.a));`);
    };
    return material;
  }
}

/** Numbers (rows of equal length) as a texture that is interpolated between its pixels; it is periodic sideways. */
function table(rows: number[][]): THREE.DataTexture {
  const half = Uint16Array.from(rows.flat(), (n) => THREE.DataUtils.toHalfFloat(n));
  const made = new THREE.DataTexture(half, rows[0]!.length, rows.length, THREE.RedFormat, THREE.HalfFloatType);
  made.wrapS = THREE.RepeatWrapping;
  made.magFilter = made.minFilter = THREE.LinearFilter;
  made.needsUpdate = true;
  return made;
}
