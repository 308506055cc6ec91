import { expect, test } from "vitest";

import { POSE } from "../fake";
import { FIELDS, fromSlider, MORE_FIELDS, toSlider, valueOf, withValue } from "./steps";

test("every field is read and written, and leaves the others alone", () => {
  for (const { name } of [...FIELDS, ...MORE_FIELDS]) {
    const changed = withValue(POSE, name, 42);
    expect(changed && valueOf(changed, name)).toBe(42);
    for (const other of [...FIELDS, ...MORE_FIELDS].filter((each) => each.name !== name)) {
      expect(changed && valueOf(changed, other.name)).toBe(valueOf(POSE, other.name));
    }
  }
});

test("angles go around, elevation ends at the poles", () => {
  expect(withValue(POSE, "azimuth", -10)?.azimuth).toBe(350);
  expect(withValue(POSE, "azimuth", 360)?.azimuth).toBe(0);
  expect(withValue(POSE, "inplane", 190)?.inplane).toBe(-170);
  expect(withValue(POSE, "elevation", 95)?.elevation).toBe(90);
});

test("what is no number, or no focal length, is refused", () => {
  expect(withValue(POSE, "azimuth", Number.NaN)).toBeNull();
  expect(withValue(POSE, "focal_px", 0)).toBeNull();
  expect(withValue(POSE, "focal_px", Number.POSITIVE_INFINITY)).toBeNull();
});

test("the focal length's slider goes by factors and comes back", () => {
  expect(toSlider(100, 10, 1000, true)).toBeCloseTo(500);
  expect(fromSlider(500, 10, 1000, true)).toBeCloseTo(100);
  expect(toSlider(5, 10, 1000, true)).toBe(0);
  for (const value of [12, 77, 940]) {
    expect(fromSlider(toSlider(value, 10, 1000, true), 10, 1000, true)).toBeCloseTo(value);
    expect(fromSlider(toSlider(value, 10, 1000, false), 10, 1000, false)).toBeCloseTo(value);
  }
});
