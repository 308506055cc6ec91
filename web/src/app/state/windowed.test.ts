import { expect, test } from "vitest";

import { reveal, visible } from "./windowed";

test("only what is in sight, and a few rows beyond", () => {
  expect(visible(0, 600, 60, 1000)).toEqual({ first: 0, end: 16 });
  expect(visible(6000, 600, 60, 1000)).toEqual({ first: 94, end: 116 });
  expect(visible(60000, 600, 60, 1000)).toEqual({ first: 994, end: 1000 });
  expect(visible(6000, 600, 60, 3)).toEqual({ first: 3, end: 3 });
  expect(visible(0, 600, 60, 0)).toEqual({ first: 0, end: 0 });
});

test("scrolls no further than it must", () => {
  expect(reveal(5, 0, 600, 60)).toBe(0);
  expect(reveal(10, 0, 600, 60)).toBe(60);
  expect(reveal(2, 300, 600, 60)).toBe(120);
});
