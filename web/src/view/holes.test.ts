import { expect, it } from "vitest";

import levels from "./fixtures/holes.json";
import { reductions } from "./holes";

it.each(levels)("reduces as OpenCV does: $width x $height", ({ width, height, data, reduced }) => {
  const ours = reductions({ data: Uint8Array.from(data), width, height });
  expect(ours).toHaveLength(reduced.length + 1);
  reduced.forEach((level, i) => {
    expect([ours[i + 1].width, ours[i + 1].height]).toEqual([level.width, level.height]);
    // Halves are rounded up or to even.
    ours[i + 1].data.forEach((value, k) => expect(Math.abs(value - level.data[k])).toBeLessThanOrEqual(1));
  });
});
