import { describe, expect, it } from "vitest";

import { rotationFromAngles, wrap180 } from "./angles";
import type { Point } from "./camera";
import type { Pose } from "./pose";
import { ballRadius, moved, rolled, scaled, turned } from "./turning";

function pose(azimuth: number, elevation: number, inplane = 0): Pose {
  return { azimuth, elevation, inplane, focal_px: 800, principal_px: [320, 240], t_z: 2 };
}

/** Where a point of the ball that is held at a pixel goes, in pixels. */
function follows(before: Pose, after: Pose, [x, y]: Point): [number, number] {
  const radius = ballRadius(before);
  const [dx, dy] = [(x - 320) / radius, (y - 240) / radius];
  const held = [dx, dy, -Math.sqrt(1 - dx * dx - dy * dy)];
  const A = rotationFromAngles(before.azimuth, before.elevation, before.inplane);
  const B = rotationFromAngles(after.azimuth, after.elevation, after.inplane);
  const own = [0, 1, 2].map((k) => A[k] * held[0] + A[3 + k] * held[1] + A[6 + k] * held[2]);
  const now = [0, 1].map((k) => B[3 * k] * own[0] + B[3 * k + 1] * own[1] + B[3 * k + 2] * own[2]);
  return [radius * (now[0] - dx), radius * (now[1] - dy)];
}

describe("dragging", () => {
  it.each([pose(0, 0), pose(180, 10), pose(75, 35, 20), pose(200, -40, 170), pose(310, 5, -95)])(
    "moves the held point with the cursor, front, back and rolled: %o",
    (start) => {
      for (const [dx, dy] of [[6, 0], [-6, 0], [0, 6], [0, -6]]) {
        const after = turned(start, [320, 240], [320 + dx, 240 + dy]);
        const [x, y] = follows(start, after, [320, 240]);
        const along = (x * dx + y * dy) / 36;
        expect(along).toBeGreaterThan(0.6);
        expect(along).toBeLessThan(1.1);
        expect(Math.abs(x * dy - y * dx) / 36).toBeLessThan(0.1);
      }
    },
  );

  it("follows the cursor in front of and behind the axis, seen from above", () => {
    for (const y of [340, 140]) {
      const start = pose(40, 89);
      const [x] = follows(start, turned(start, [320, y], [326, y]), [320, y]);
      expect(x).toBeGreaterThan(3);
    }
  });

  it("does not jump at the poles", () => {
    let now = pose(123, 70);
    let last = now;
    for (let y = 240; y < 500; y += 2) {
      now = turned(now, [300, y], [301, y + 2]);
      expect(Math.abs(now.elevation - last.elevation)).toBeLessThan(3);
      expect(Math.abs(wrap180(now.azimuth - last.azimuth))).toBeLessThan(3);
      last = now;
    }
    expect(now.elevation).toBe(90);
  });

  it("comes back where a drag comes back", () => {
    const start = pose(20, 15, 5);
    const there = turned(start, [300, 250], [380, 270]);
    const back = turned(there, [380, 270], [300, 250]);
    expect(wrap180(back.azimuth - start.azimuth)).toBeCloseTo(0, 0);
    expect(back.elevation).toBeCloseTo(start.elevation, 0);
  });

  it("is the same in one step as in many", () => {
    const one = turned(pose(20, 15), [300, 250], [360, 230]);
    let many = pose(20, 15);
    for (let i = 0; i < 60; i++) many = turned(many, [300 + i, 250 - i / 3], [301 + i, 250 - (i + 1) / 3]);
    expect(one.azimuth).toBeCloseTo(many.azimuth, 0);
    expect(one.elevation).toBeCloseTo(many.elevation, 1);
  });

  it("turns a small object less than its ball would", () => {
    const small = { ...pose(0, 0), focal_px: 20 };
    const plain = turned(small, [320, 240], [322, 240], 0);
    const eased = turned(small, [320, 240], [322, 240], 100);
    expect(Math.abs(wrap180(eased.azimuth))).toBeLessThan(Math.abs(wrap180(plain.azimuth)) / 10);
  });
});

describe("rolling", () => {
  it("goes with the cursor about the principal point, counter-clockwise being positive", () => {
    expect(rolled(pose(0, 0), [420, 240], [320, 140]).inplane).toBeCloseTo(90, 9);
    expect(rolled(pose(0, 0, 170), [420, 240], [320, 140]).inplane).toBeCloseTo(-100, 9);
  });

  it("does nothing close to the middle", () => {
    expect(rolled(pose(0, 0), [321, 240], [320, 239])).toEqual(pose(0, 0));
  });
});

it("moves and scales about the principal point", () => {
  expect(moved(pose(0, 0), 3, -4).principal_px).toEqual([323, 236]);
  expect(scaled(pose(0, 0), 1.5).focal_px).toBe(1200);
  expect(scaled(pose(0, 0), 0).focal_px).toBe(1);
});
