import { describe, expect, it } from "vitest";

import masks from "./fixtures/rle.json";
import { decodeRle, encodeRle, type Rle } from "./rle";

describe("run lengths", () => {
  it.each(masks)("are those of pycocotools: $name", ({ rows, rle }) => {
    const [height, width] = rle.size;
    const mask = Uint8Array.from([...rows.join("")].map(Number));
    expect(encodeRle(mask, width, height)).toEqual(rle);
    expect(decodeRle(rle as Rle)).toEqual(mask);
  });

  it("hold long runs", () => {
    const [width, height] = [3000, 2000];
    const mask = new Uint8Array(width * height);
    mask.fill(1, 2_000_000, 4_500_001);
    const back = decodeRle(encodeRle(mask, width, height));
    expect(back.length).toBe(mask.length);
    expect(back.every((value, i) => value === mask[i])).toBe(true);
  });

  it.each([
    [{ size: [2, 2], counts: "3" }, "fill"],
    [{ size: [2, 2], counts: "13 " }, "none may hold"],
    [{ size: [2, 2], counts: "1P" }, "within a number"],
    [{ size: [2, 2], counts: "9" }, "fit"],
    [{ size: [0, 2], counts: "" }, "cannot be read"],
    [{ size: [1e6, 1e6], counts: "0" }, "cannot be read"],
  ])("that fit nothing are refused: %o", (rle, why) => {
    expect(() => decodeRle(rle as Rle)).toThrow(why);
  });

  it("need a mask of that size", () => {
    expect(() => encodeRle(new Uint8Array(5), 2, 3)).toThrow("6 values, not 5");
  });
});
