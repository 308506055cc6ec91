/** Lines of any width in space, one quad each. */
import * as THREE from "three";

import { LINE_FRAGMENT, LINE_VERTEX } from "./shaders";

type Shared = Record<"toCamera" | "toClip", THREE.IUniform<THREE.Matrix4>>;

export class Lines {
  private readonly scene = new THREE.Scene();
  private readonly geometry = new THREE.InstancedBufferGeometry();
  private readonly material: THREE.RawShaderMaterial;

  /** `ends`: six numbers a line. */
  constructor(ends: Float32Array, shared: Shared) {
    const corners = new Float32Array([0, -1, 1, -1, 1, 1, 0, 1]);
    this.geometry.setAttribute("position", new THREE.BufferAttribute(corners, 2));
    this.geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const both = new THREE.InstancedInterleavedBuffer(ends, 6);
    this.geometry.setAttribute("start", new THREE.InterleavedBufferAttribute(both, 3, 0));
    this.geometry.setAttribute("end", new THREE.InterleavedBufferAttribute(both, 3, 3));
    this.geometry.instanceCount = ends.length / 6;
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
