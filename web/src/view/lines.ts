/** Lines of any width in space, one quad each. */
import * as THREE from "three";

import { LINE_FRAGMENT, LINE_VERTEX } from "./shaders";

/** Which end, and which side of the line, of a quad's corners. */
const CORNERS = [0, -1, 1, -1, 1, 1, 0, 1];
const QUAD = [0, 1, 2, 0, 2, 3];

type Shared = Record<"toCamera" | "toClip", THREE.IUniform<THREE.Matrix4>>;

export class Lines {
  private readonly scene = new THREE.Scene();
  private readonly geometry = new THREE.BufferGeometry();
  private readonly material: THREE.RawShaderMaterial;

  /** `ends`: six numbers a line. */
  constructor(ends: Float32Array, shared: Shared) {
    // Not one quad drawn many times: graphics by the CPU take each of them for a drawing of its own.
    const count = ends.length / 6;
    const both = new Float32Array(24 * count);
    const corners = new Int8Array(8 * count);
    const index = new Uint32Array(6 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 4; k++) both.set(ends.subarray(6 * i, 6 * i + 6), 24 * i + 6 * k);
      corners.set(CORNERS, 8 * i);
      for (let k = 0; k < 6; k++) index[6 * i + k] = 4 * i + QUAD[k];
    }
    const pairs = new THREE.InterleavedBuffer(both, 6);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(corners, 2));
    this.geometry.setAttribute("start", new THREE.InterleavedBufferAttribute(pairs, 3, 0));
    this.geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(pairs, 3, 3));
    this.geometry.setIndex(new THREE.BufferAttribute(index, 1));
    // three would measure it to sort by distance, which the order to draw replaces.
    this.geometry.boundingSphere = new THREE.Sphere();
    this.material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: LINE_VERTEX,
      fragmentShader: LINE_FRAGMENT,
      side: THREE.DoubleSide,
      depthWrite: false,
      // Where lines meet, the stronger one shows.
      blending: THREE.CustomBlending,
      blendEquation: THREE.MaxEquation,
      blendSrc: THREE.OneFactor,
      blendDst: THREE.OneFactor,
      uniforms: {
        ...shared,
        size: { value: new THREE.Vector2() },
        width: { value: 1 },
        strength: { value: 1 },
      },
    });
    const mesh = new THREE.Mesh(this.geometry, this.material);
    mesh.frustumCulled = false;
    if (ends.length) this.scene.add(mesh);
  }

  /** Into the renderer's target of that size in pixels; `hidden`: those behind the model too. */
  draw(renderer: THREE.WebGLRenderer, size: THREE.Vector2, width: number, strength: number, hidden: boolean): void {
    const { uniforms } = this.material;
    (uniforms.size.value as THREE.Vector2).copy(size);
    uniforms.width.value = width;
    uniforms.strength.value = strength;
    this.material.depthTest = !hidden;
    renderer.render(this.scene, NO_CAMERA);
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}

const NO_CAMERA = new THREE.Camera();
