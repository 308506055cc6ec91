import { describe, expect, it } from "vitest";

import { Frame } from "./frame";

function frame(): Frame {
  const made = new Frame();
  made.resize(800, 600);
  made.setPhoto(400, 200);
  return made;
}

describe("the photo's place", () => {
  it("is the middle, as large as fits", () => {
    expect(frame().scale).toBeCloseTo((800 - 24) / 400, 12);
    expect(frame().toScreen([200, 100])).toEqual([400, 300]);
    expect(frame().window.x).toBeCloseTo(200 - 400 / frame().scale, 12);
  });

  it("goes both ways", () => {
    const made = frame();
    made.zoomAt(2.5, [100, 500]);
    made.pan(-30, 12);
    const [x, y] = made.toPhoto(made.toScreen([123, 45]));
    expect(x).toBeCloseTo(123, 9);
    expect(y).toBeCloseTo(45, 9);
  });

  it("keeps the point that is zoomed at", () => {
    const made = frame();
    const before = made.toPhoto([300, 350]);
    made.zoomAt(3, [300, 350]);
    expect(made.zoom).toBe(3);
    const [x, y] = made.toPhoto([300, 350]);
    expect(x).toBeCloseTo(before[0], 9);
    expect(y).toBeCloseTo(before[1], 9);
  });

  it("is never smaller than fits, nor lost", () => {
    const made = frame();
    made.zoomAt(0.1, [0, 0]);
    expect(made.zoom).toBe(1);
    made.zoomAt(4, [400, 300]);
    made.pan(1e6, -1e6);
    expect(made.toScreen([0, 200])).toEqual([400, 300]);
    made.zoomAt(1e9, [400, 300]);
    expect(made.scale).toBeCloseTo(40, 9);
  });

  it("shows a small box large and in the middle", () => {
    const made = frame();
    made.focus([100, 50, 110, 60]);
    expect(made.toScreen([105, 55])).toEqual([400, 300]);
    expect(made.scale).toBeGreaterThan(30);
  });

  it("stays where a photo of the same size follows, and fits another", () => {
    const made = frame();
    made.zoomAt(2, [0, 0]);
    made.setPhoto(400, 200);
    expect(made.zoom).toBe(2);
    made.setPhoto(300, 900);
    expect(made.zoom).toBe(1);
  });
});
