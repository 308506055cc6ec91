import { describe, expect, it } from "vitest";

import { area, boxOf, filled, ringsOf, simplified, traced, type Ring } from "./polygon";

/** Same numbers each time (mulberry32). */
function random(seed: number): () => number {
  return () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  };
}

function drawn(text: string): { mask: Uint8Array; width: number; height: number } {
  const rows = text.trim().split(/\s+/);
  return {
    mask: Uint8Array.from([...rows.join("")].map((c) => (c === "#" ? 1 : 0))),
    width: rows[0].length,
    height: rows.length,
  };
}

describe("filled", () => {
  it("takes pixels whose centres are inside", () => {
    const mask = filled([[[0.4, 0], [2.6, 0], [2.6, 2.4], [0.4, 2.4]]], 4, 3);
    expect([...mask]).toEqual([1, 1, 1, 0, 1, 1, 1, 0, 0, 0, 0, 0]);
  });

  it("leaves what a ring within a ring holds, whichever way it goes", () => {
    const outer: Ring = [[0, 0], [5, 0], [5, 5], [0, 5]];
    const hole: Ring = [[1, 1], [4, 1], [4, 4], [1, 4]];
    for (const inner of [hole, hole.toReversed()]) {
      expect(filled([outer, inner], 5, 5).reduce((a, b) => a + b, 0)).toBe(16);
    }
  });

  it("cuts off what is beyond the photo", () => {
    const mask = filled([[[-10, -10], [50, -10], [50, 1], [-10, 1]]], 3, 2);
    expect([...mask]).toEqual([1, 1, 1, 0, 0, 0]);
  });

  it("shares the pixels of two halves exactly", () => {
    const [width, height] = [17, 13];
    const left: Ring = [[0, 0], [9.3, 0], [4.1, 13], [0, 13]];
    const right: Ring = [[9.3, 0], [17, 0], [17, 13], [4.1, 13]];
    const [a, b] = [filled([left], width, height), filled([right], width, height)];
    expect(a.map((value, i) => value + b[i]).every((sum) => sum === 1)).toBe(true);
  });
});

describe("traced", () => {
  it("goes back to the same mask, with holes and pixels that touch at corners", () => {
    const next = random(7);
    for (let round = 0; round < 60; round++) {
      const [width, height] = [1 + Math.floor(next() * 14), 1 + Math.floor(next() * 14)];
      const mask = Uint8Array.from({ length: width * height }, () => (next() < 0.55 ? 1 : 0));
      expect(filled(traced(mask, width, height), width, height)).toEqual(mask);
    }
  });

  it("gives an outer ring and a hole of opposite senses, corners only", () => {
    const { mask, width, height } = drawn("##### #...# #...# #####");
    const [outer, hole] = traced(mask, width, height);
    expect(outer).toEqual([[0, 0], [5, 0], [5, 4], [0, 4]]);
    expect(area(outer)).toBe(20);
    expect(area(hole)).toBe(-6);
  });

  it("keeps pixels apart that touch at a corner", () => {
    const { mask, width, height } = drawn("#. .#");
    expect(traced(mask, width, height).map(area)).toEqual([1, 1]);
  });

  it("finds nothing in nothing", () => {
    expect(traced(new Uint8Array(6), 3, 2)).toEqual([]);
  });
});

describe("simplified", () => {
  it("keeps corners and drops what lies on an edge", () => {
    const ring: Ring = [[0, 0], [5, 0.2], [10, 0], [10, 5], [10, 10], [0, 10]];
    expect(simplified(ring, 0.5)).toEqual([[0, 0], [10, 0], [10, 10], [0, 10]]);
    expect(simplified(ring, 0.1)).toContainEqual([5, 0.2]);
  });

  it("keeps a disc within two hundredths", () => {
    const size = 120;
    const mask = Uint8Array.from({ length: size * size }, (_, i) =>
      Math.hypot((i % size) - 60, Math.floor(i / size) - 60) < 45 ? 1 : 0,
    );
    const rings = ringsOf(mask, size, size);
    expect(rings).toHaveLength(1);
    expect(rings[0].length).toBeLessThan(60);
    const again = filled(rings, size, size);
    const both = again.reduce((sum, value, i) => sum + (value & mask[i]), 0);
    const either = again.reduce((sum, value, i) => sum + (value | mask[i]), 0);
    expect(both / either).toBeGreaterThan(0.98);
  });
});

describe("boxOf", () => {
  it("is cut off at the photo's edges", () => {
    expect(boxOf([[[-3, 2], [8, 2], [8, 30]]], 6, 20)).toEqual([0, 2, 6, 20]);
    expect(boxOf([], 6, 20)).toBeNull();
  });
});
