import { describe, expect, it } from "vitest";

import { anglesFromRotation, flipped, geodesicDegrees, rotationFromAngles, transposed, multiply, twin, wrap180, wrap360 } from "./angles";
import { modelView, project, projection } from "./camera";
import numbers from "./fixtures/angles.json";
import type { Pose } from "./pose";

const TURN: Pose = { azimuth: 30, elevation: 20, inplane: -10, focal_px: 500, principal_px: [300, 200], t_z: 2 };

describe("angles", () => {
  it.each(numbers.rotations)("are those of Python: %o", ({ angles, R, decoded }) => {
    const [azimuth, elevation, inplane] = angles;
    const ours = rotationFromAngles(azimuth, elevation, inplane);
    ours.forEach((value, i) => expect(value).toBeCloseTo(R[i], 12));
    const back = anglesFromRotation(R);
    expect(back.elevation).toBeCloseTo(decoded[1], 9);
    expect(wrap180(back.azimuth - decoded[0])).toBeCloseTo(0, 9);
    expect(wrap180(back.inplane - decoded[2])).toBeCloseTo(0, 9);
  });

  it("stay in their ranges", () => {
    expect(wrap360(-1e-17)).toBe(0);
    expect(wrap360(725)).toBe(5);
    expect(wrap180(-180)).toBe(180);
    expect(wrap180(190)).toBe(-170);
  });

  it("turn by half about the vertical", () => {
    const before = rotationFromAngles(TURN.azimuth, TURN.elevation, TURN.inplane);
    const { azimuth, elevation, inplane } = flipped(TURN);
    const after = rotationFromAngles(azimuth, elevation, inplane);
    const half = multiply(transposed(before), after);
    [-1, 0, 0, 0, 1, 0, 0, 0, -1].forEach((value, i) => expect(half[i]).toBeCloseTo(value, 12));
    expect(geodesicDegrees(before, after)).toBeCloseTo(180, 9);
  });

  it("know the twin by a symmetry of the model", () => {
    const S = [0, 0, 1, 0, 1, 0, -1, 0, 0];
    const { azimuth, elevation, inplane } = twin(TURN, S);
    expect(elevation).toBeCloseTo(20, 9);
    expect(inplane).toBeCloseTo(-10, 9);
    expect(Math.abs(wrap180(azimuth - 30))).toBeCloseTo(90, 9);
  });

  it("measure small and large turns exactly", () => {
    const start = rotationFromAngles(10, 20, 30);
    expect(geodesicDegrees(start, rotationFromAngles(10, 20, 30 + 1e-6))).toBeCloseTo(1e-6, 12);
    expect(geodesicDegrees(start, start)).toBe(0);
  });
});

describe("the camera", () => {
  it.each(numbers.projections)("projects as Python does: %o", ({ pose, width, height, points, pixels }) => {
    const told = pose as Pose;
    points.forEach((point, i) => {
      const ours = project(told, point) as [number, number];
      expect(ours[0]).toBeCloseTo(pixels[i][0], 8);
      expect(ours[1]).toBeCloseTo(pixels[i][1], 8);
      // And through the matrices that WebGL gets.
      const camera = apply(modelView(told), [...point, 1]);
      const [x, y, , w] = apply(projection(told, { x: 0, y: 0, width, height }, 0.1, 9), camera);
      expect(((x / w + 1) / 2) * width).toBeCloseTo(pixels[i][0], 8);
      expect(((1 - y / w) / 2) * height).toBeCloseTo(pixels[i][1], 8);
    });
  });
});

function apply(m: readonly number[], v: readonly number[]): number[] {
  return [0, 1, 2, 3].map((row) => m[row] * v[0] + m[4 + row] * v[1] + m[8 + row] * v[2] + m[12 + row] * v[3]);
}
