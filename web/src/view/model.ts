/** A CAD model on the graphics card, drawn by the camera of a pose. */
import * as THREE from "three";

import { type Bounds, depthRange, modelView, projection, type Window } from "./camera";
import { edgesOf, type Edges } from "./edges";
import { parseGlb, type Piece } from "./glb";
import { holesOf } from "./holes";
import { Lines } from "./lines";
import type { Pose } from "./pose";
import { MODEL_FRAGMENT, MODEL_VERTEX } from "./shaders";

/** Of its distance that a face may lie behind another and is still drawn over it: rendering/visibility.py. */
const COPLANAR = 4e-5;
/** By what part of its distance a surface moves back from the lines on it. */
const BEHIND_LINES = 1.5e-3;
const OPAQUE_HERE = 1;

export type Look = "shaded" | "white" | "depth";

export class Model {
  readonly scene = new THREE.Scene();
  readonly bounds: Bounds;
  private readonly shared = {
    toCamera: { value: new THREE.Matrix4() },
    toClip: { value: new THREE.Matrix4() },
    normalToCamera: { value: new THREE.Matrix3() },
    push: { value: 0 },
    look: { value: 0 },
    fineness: { value: 1 },
  };
  /** Opacities of textures with holes. */
  private readonly holes = new Map<number, THREE.Texture>();
  private readonly materials: THREE.RawShaderMaterial[] = [];
  private readonly geometries: THREE.BufferGeometry[] = [];
  private edges: Edges | null = null;
  private readonly lines = new Map<keyof Edges, Lines>();

  private constructor(
    private readonly pieces: Piece[],
    private readonly textures: THREE.Texture[],
  ) {
    this.scene.matrixWorldAutoUpdate = false;
    this.bounds = boundsOf(pieces);
    // As the rasteriser: opaque, then with holes, then glass.
    const order = [...pieces.keys()].sort((a, b) => RANK[pieces[a].kind] - RANK[pieces[b].kind] || a - b);
    order.forEach((index, place) => this.add(pieces[index], place, (COPLANAR * place) / order.length));
  }

  /** Throws an Error where the bytes are no model. */
  static async from(buffer: ArrayBuffer): Promise<Model> {
    const { pieces, images } = parseGlb(buffer);
    const textures = await Promise.all(images.map(textureOf));
    return new Model(pieces, textures);
  }

  /** Draw the part of the photo in `window` from now on. */
  aim(pose: Pose, window: Window): void {
    const { toCamera, toClip, normalToCamera } = this.shared;
    toCamera.value.fromArray(modelView(pose));
    normalToCamera.value.setFromMatrix4(toCamera.value);
    toClip.value.fromArray(projection(pose, window, ...depthRange(pose, this.bounds)));
  }

  /**
   * Into the renderer's target, which has a stencil and was cleared.
   *
   * @param fineness Fragments of a sample along each axis: holes of textures are looked up for whole samples.
   */
  draw(renderer: THREE.WebGLRenderer, look: Look, fineness = 1): void {
    this.shared.fineness.value = fineness;
    this.shared.look.value = look === "white" ? 1 : 0;
    this.shared.push.value = look === "depth" ? BEHIND_LINES : 0;
    // Only glass's own pass of depths is without colour otherwise.
    for (const material of this.materials) material.colorWrite = look !== "depth" && !material.userData.depthOnly;
    renderer.render(this.scene, NO_CAMERA);
  }

  /** The lines of these edges, by the same camera. */
  edgeLines(which: keyof Edges): Lines {
    let lines = this.lines.get(which);
    if (!lines) {
      this.edges ??= edgesOf(this.pieces);
      lines = new Lines(this.edges[which], { toCamera: this.shared.toCamera, toClip: this.shared.toClip });
      this.lines.set(which, lines);
    }
    return lines;
  }

  /** Frees what lies on the graphics card; drawing again brings it back. */
  dispose(): void {
    const { materials, geometries, textures, holes, lines } = this;
    for (const kept of [...materials, ...geometries, ...textures, ...holes.values(), ...lines.values()]) kept.dispose();
  }

  private holesIn(image: number): THREE.Texture {
    const known = this.holes.get(image) ?? holesOf(this.textures[image].image as ImageBitmap);
    this.holes.set(image, known);
    return known;
  }

  private add(piece: Piece, place: number, bias: number): void {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(piece.positions, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(piece.normals, 3));
    if (piece.uv) geometry.setAttribute("uv", new THREE.BufferAttribute(piece.uv, 2));
    geometry.setIndex(new THREE.BufferAttribute(piece.indices, 1));
    // three would measure it to sort by distance, which the order to draw replaces.
    geometry.boundingSphere = new THREE.Sphere();
    this.geometries.push(geometry);

    const put = (settings: THREE.ShaderMaterialParameters, whole: boolean, step: number): void => {
      const textured = piece.image !== null && piece.uv !== null;
      const holes = textured && piece.kind === "MASK" ? this.holesIn(piece.image as number) : null;
      const material = new THREE.RawShaderMaterial({
        glslVersion: THREE.GLSL3,
        vertexShader: MODEL_VERTEX,
        fragmentShader: MODEL_FRAGMENT,
        side: THREE.DoubleSide,
        blending: THREE.NoBlending,
        depthFunc: THREE.LessEqualDepth,
        stencilWrite: true,
        stencilRef: OPAQUE_HERE,
        ...settings,
        defines: {
          ...(textured ? { TEXTURED: 1 } : {}),
          ...(holes ? { CUTOUT: 1 } : {}),
        },
        uniforms: {
          ...this.shared,
          bias: { value: bias },
          colour: { value: new THREE.Vector4(...piece.colour) },
          whole: { value: whole ? 1 : 0 },
          holes: { value: holes },
          map: { value: textured ? this.textures[piece.image as number] : null },
        },
      });
      material.userData.depthOnly = settings.colorWrite === false;
      this.materials.push(material);
      const mesh = new THREE.Mesh(geometry, material);
      mesh.frustumCulled = false;
      // First all depths of glass, so that only its nearest layer is seen.
      mesh.renderOrder = step * 1e6 + place;
      this.scene.add(mesh);
    };
    if (piece.kind !== "BLEND") {
      put({ stencilFunc: THREE.AlwaysStencilFunc, stencilZPass: THREE.ReplaceStencilOp }, true, 0);
      return;
    }
    put({ colorWrite: false, stencilWrite: false }, true, 1);
    // Over something it is mixed in, over nothing it shows its own colour: both cover their pixel.
    put(
      {
        stencilFunc: THREE.EqualStencilFunc,
        depthWrite: false,
        blending: THREE.CustomBlending,
        blendSrc: THREE.SrcAlphaFactor,
        blendDst: THREE.OneMinusSrcAlphaFactor,
        blendSrcAlpha: THREE.OneFactor,
        blendDstAlpha: THREE.OneFactor,
      },
      false,
      2,
    );
    put({ stencilFunc: THREE.NotEqualStencilFunc, depthWrite: false }, true, 2);
  }
}

const RANK = { OPAQUE: 0, MASK: 1, BLEND: 2 };
/** The shaders have matrices of their own. */
const NO_CAMERA = new THREE.Camera();

async function textureOf(image: Blob): Promise<THREE.Texture> {
  const bitmap = await createImageBitmap(image, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
  const texture = new THREE.Texture(bitmap);
  texture.flipY = false;
  texture.colorSpace = THREE.NoColorSpace;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.needsUpdate = true;
  return texture;
}

function boundsOf(pieces: readonly Piece[]): Bounds {
  const bounds = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  for (const { positions } of pieces) {
    for (let i = 0; i < positions.length; i++) {
      const k = i % 3;
      bounds[k] = Math.min(bounds[k], positions[i]);
      bounds[3 + k] = Math.max(bounds[3 + k], positions[i]);
    }
  }
  return pieces.length ? bounds : [0, 0, 0, 0, 0, 0];
}
