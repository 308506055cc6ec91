/** A fragment shader over a whole picture. */
import * as THREE from "three";

const VERTEX = /* glsl */ `
in vec2 position;
void main() { gl_Position = vec4(position, 0.0, 1.0); }
`;

export class Pass {
  private readonly scene = new THREE.Scene();
  private readonly camera = new THREE.Camera();
  private readonly geometry = new THREE.BufferGeometry();
  private readonly material: THREE.RawShaderMaterial;

  constructor(fragment: string, values: Record<string, unknown>) {
    // One triangle that is larger than the picture.
    this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-1, -1, 3, -1, -1, 3]), 2));
    // three would measure it to sort by distance, which the order to draw replaces.
    this.geometry.boundingSphere = new THREE.Sphere();
    this.material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: VERTEX,
      fragmentShader: fragment,
      depthTest: false,
      depthWrite: false,
      blending: THREE.NoBlending,
      uniforms: Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }])),
    });
    const mesh = new THREE.Mesh(this.geometry, this.material);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
  }

  set(values: Record<string, unknown>): void {
    for (const [name, value] of Object.entries(values)) this.material.uniforms[name].value = value;
  }

  /** Into the target, null being the canvas. */
  draw(renderer: THREE.WebGLRenderer, target: THREE.WebGLRenderTarget | null): void {
    renderer.setRenderTarget(target);
    renderer.render(this.scene, this.camera);
  }

  dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}
