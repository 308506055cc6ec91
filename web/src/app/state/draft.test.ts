import { expect, test } from "vitest";

import { cadOf, detailOf, POSE } from "../fake";
import { changesOf, describe, draftOf, isChanged, samePose, turn } from "./draft";

test("the same pose another way round is no change", () => {
  expect(samePose(POSE, { ...POSE, azimuth: POSE.azimuth + 360, inplane: -360 })).toBe(true);
  expect(samePose(POSE, { ...POSE, azimuth: POSE.azimuth + 0.1 })).toBe(false);
  expect(samePose(POSE, { ...POSE, principal_px: [320, 241] })).toBe(false);
});

test("turns the short way", () => {
  expect(turn(350, 10)).toBe(20);
  expect(turn(10, 350)).toBe(-20);
  expect(turn(10, 190)).toBe(-180);
});

test("tells only what changed", () => {
  const base = draftOf(detailOf("a1"));
  expect(isChanged(base, base)).toBe(false);
  const other = { ...base, cad: cadOf("b") };
  expect(changesOf(base, other)).toEqual({ pose: null, cad_id: "b", region: null });
  const turned = { ...base, pose: { ...POSE, azimuth: 20, focal_px: 880 } };
  expect(describe(base, turned)).toEqual(["azimuth −10.0°", "focal length +10.0 %"]);
  expect(describe(base, other)).toEqual(["model Model b"]);
});
