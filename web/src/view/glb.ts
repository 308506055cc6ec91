/** Reads the binary glTF that src/cadpose/annotations/scenes/gltf_meshes.py writes: one mesh, its primitives in the order to draw. */

export type Kind = "OPAQUE" | "MASK" | "BLEND";

export interface Piece {
  positions: Float32Array;
  normals: Float32Array;
  /** (0, 0) is the top left of the texture. */
  uv: Float32Array | null;
  indices: Uint16Array | Uint32Array;
  /** As displayed (sRGB) in [0, 1], and opacity. */
  colour: [number, number, number, number];
  kind: Kind;
  /** Which of the images covers it. */
  image: number | null;
}

export interface Glb {
  pieces: Piece[];
  images: Blob[];
}

interface Json {
  accessors: { bufferView: number; componentType: number; count: number; type: string }[];
  bufferViews: { byteOffset?: number; byteLength: number }[];
  images?: { bufferView: number; mimeType: string }[];
  textures?: { source: number }[];
  materials: {
    alphaMode?: Kind;
    pbrMetallicRoughness: { baseColorFactor: number[]; baseColorTexture?: { index: number } };
  }[];
  meshes?: { primitives: { attributes: Record<string, number>; indices: number; material: number }[] }[];
}

const MAGIC = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const NUMBERS: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3 };

/** Throws an Error where the bytes are no such file. */
export function parseGlb(buffer: ArrayBuffer): Glb {
  const view = new DataView(buffer);
  if (buffer.byteLength < 20 || view.getUint32(0, true) !== MAGIC || view.getUint32(16, true) !== JSON_CHUNK) {
    throw new Error("the model is no binary glTF file");
  }
  const length = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length))) as Json;
  const start = 20 + length + 8;

  const bytes = (index: number): [number, number] => {
    const { byteOffset = 0, byteLength } = json.bufferViews[index];
    return [start + byteOffset, byteLength];
  };
  const floats = (index: number): Float32Array => {
    const { bufferView, count, type } = json.accessors[index];
    return new Float32Array(buffer, bytes(bufferView)[0], count * NUMBERS[type]);
  };
  const indices = (index: number): Uint16Array | Uint32Array => {
    const { bufferView, componentType, count } = json.accessors[index];
    const Type = componentType === 5123 ? Uint16Array : Uint32Array;
    return new Type(buffer, bytes(bufferView)[0], count);
  };

  // Where all materials are invisible there is no mesh.
  const pieces = (json.meshes?.[0].primitives ?? []).map((primitive): Piece => {
    const material = json.materials[primitive.material];
    const { baseColorFactor: factor, baseColorTexture: texture } = material.pbrMetallicRoughness;
    return {
      positions: floats(primitive.attributes.POSITION),
      normals: floats(primitive.attributes.NORMAL),
      uv: "TEXCOORD_0" in primitive.attributes ? floats(primitive.attributes.TEXCOORD_0) : null,
      indices: indices(primitive.indices),
      colour: [displayed(factor[0]), displayed(factor[1]), displayed(factor[2]), factor[3]],
      kind: material.alphaMode ?? "OPAQUE",
      image: texture ? (json.textures ?? [])[texture.index].source : null,
    };
  });
  const images = (json.images ?? []).map(({ bufferView, mimeType }) => {
    const [offset, size] = bytes(bufferView);
    return new Blob([new Uint8Array(buffer, offset, size)], { type: mimeType });
  });
  return { pieces, images };
}

/** Linear light to display colour (IEC 61966-2-1). */
function displayed(linear: number): number {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
}
