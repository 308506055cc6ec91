import { expect, it } from "vitest";

import { edgesOf } from "./edges";
import type { Piece } from "./glb";

/** Of quads as pairs of triangles, each with corners of its own. */
function quads(...corners: number[][][]): Piece {
  const positions = new Float32Array(corners.flat(2));
  const indices = corners.flatMap((_, i) => [0, 1, 2, 0, 2, 3].map((k) => 4 * i + k));
  return {
    positions,
    normals: new Float32Array(positions.length),
    uv: null,
    indices: new Uint16Array(indices),
    colour: [1, 1, 1, 1],
    kind: "OPAQUE",
    image: null,
  };
}

const floor = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
const wall = [[1, 0, 0], [1, 0, 1], [1, 1, 1], [1, 1, 0]];
const beside = [[1, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0]];
const slope = [[1, 0, 0], [2, 0, 0.2], [2, 1, 0.2], [1, 1, 0]];

function count(...pieces: Piece[]): [number, number] {
  const { creases, wires } = edgesOf(pieces);
  return [creases.length / 6, wires.length / 6];
}

it("finds rims and sharp edges, not the diagonals of flat quads", () => {
  expect(count(quads(floor))).toEqual([4, 4]);
  expect(count(quads(floor, wall))).toEqual([7, 7]);
});

it("sees corners of pieces that lie on each other as one", () => {
  expect(count(quads(floor), quads(beside))).toEqual([6, 6]);
});

it("tells a blunt edge as a wire only", () => {
  expect(count(quads(floor, slope))).toEqual([6, 7]);
});

it("leaves out faces without area", () => {
  expect(count(quads([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]))).toEqual([0, 0]);
});
