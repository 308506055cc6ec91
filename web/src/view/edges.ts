/** The edges of a model: those between faces that meet at an angle, and those of one face only. */
import type { Piece } from "./glb";

export interface Edges {
  /** Six numbers an edge: its two ends. Where faces meet at more than 30°, and rims. */
  creases: Float32Array;
  /** All but those inside flat polygons. */
  wires: Float32Array;
}

const CREASE = Math.cos((30 * Math.PI) / 180);
const FLAT = Math.cos((0.5 * Math.PI) / 180);
/** Corners closer than that are one. */
const WELD = 1e-5;

export function edgesOf(pieces: readonly Piece[]): Edges {
  const { points, corners } = welded(pieces);
  const count = points.length / 3;
  // Edge to the normals of its faces, three numbers each.
  const normals = new Map<number, number[]>();
  for (let f = 0; f < corners.length; f += 3) {
    const face = [corners[f], corners[f + 1], corners[f + 2]];
    const normal = faceNormal(points, face);
    if (!normal) continue;
    for (let k = 0; k < 3; k++) {
      const [a, b] = [face[k], face[(k + 1) % 3]];
      const key = a < b ? a * count + b : b * count + a;
      const known = normals.get(key);
      if (known) known.push(...normal);
      else normals.set(key, [...normal]);
    }
  }
  const creases: number[] = [];
  const wires: number[] = [];
  for (const [key, met] of normals) {
    const sharpest = least(met);
    const ends = [Math.floor(key / count), key % count].flatMap((i) => [...points.subarray(3 * i, 3 * i + 3)]);
    if (sharpest < CREASE) creases.push(...ends);
    if (sharpest < FLAT) wires.push(...ends);
  }
  return { creases: new Float32Array(creases), wires: new Float32Array(wires) };
}

/** Cosine of the largest angle between two of an edge's faces, either way round; -1 of a rim. */
function least(normals: number[]): number {
  if (normals.length === 3) return -1;
  let smallest = 1;
  for (let i = 3; i < normals.length; i += 3) {
    const cosine = normals[0] * normals[i] + normals[1] * normals[i + 1] + normals[2] * normals[i + 2];
    // Windings of CAD models do not agree: a face may be seen from behind.
    smallest = Math.min(smallest, Math.abs(cosine));
  }
  return smallest;
}

function welded(pieces: readonly Piece[]): { points: Float32Array; corners: Uint32Array } {
  const points = new Float32Array(pieces.reduce((sum, piece) => sum + piece.positions.length, 0));
  const corners = new Uint32Array(pieces.reduce((sum, piece) => sum + piece.indices.length, 0));
  const known = new Map<string, number>();
  let at = 0;
  for (const { positions, indices } of pieces) {
    const number = new Uint32Array(positions.length / 3);
    for (let i = 0; i < number.length; i++) {
      const [x, y, z] = positions.subarray(3 * i, 3 * i + 3);
      const key = `${Math.round(x / WELD)},${Math.round(y / WELD)},${Math.round(z / WELD)}`;
      let found = known.get(key);
      if (found === undefined) {
        found = known.size;
        known.set(key, found);
        points.set([x, y, z], 3 * found);
      }
      number[i] = found;
    }
    for (const index of indices) corners[at++] = number[index];
  }
  return { points: points.subarray(0, 3 * known.size), corners };
}

function faceNormal(points: Float32Array, [a, b, c]: number[]): number[] | null {
  const u = [0, 1, 2].map((k) => points[3 * b + k] - points[3 * a + k]);
  const v = [0, 1, 2].map((k) => points[3 * c + k] - points[3 * a + k]);
  const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(n[0], n[1], n[2]);
  return length > 1e-14 ? n.map((x) => x / length) : null;
}
