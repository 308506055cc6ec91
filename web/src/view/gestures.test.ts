// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, test, vi } from "vitest";

import { Gestures } from "./gestures";
import type { Pose } from "./pose";

const POSE: Pose = { azimuth: 30, elevation: 10, inplane: 0, focal_px: 800, principal_px: [300, 200], t_z: 3 };

let element: HTMLElement;
let gestures: Gestures;
let pose: Pose;
let paused: boolean;
let told: { pose: Pose; done: boolean }[];

beforeEach(() => {
  vi.useFakeTimers();
  element = document.body.appendChild(document.createElement("div"));
  element.setPointerCapture = () => undefined;
  pose = POSE;
  paused = false;
  told = [];
  gestures = new Gestures(element, {
    pose: () => pose,
    change: (next, done) => {
      pose = next;
      told.push({ pose: next, done });
    },
    toPhoto: (point) => point,
    pan: () => undefined,
    zoom: () => undefined,
    interactive: () => true,
    paused: () => paused,
    leastRadius: () => 0,
  });
});

afterEach(() => {
  gestures.dispose();
  element.remove();
  vi.useRealTimers();
});

function pointer(kind: string, clientX: number): void {
  element.dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX, clientY: 200, cancelable: true }));
}

function wheel(): void {
  element.dispatchEvent(new WheelEvent("wheel", { deltaY: -100, cancelable: true }));
}

const finals = (): Pose[] => told.filter((each) => each.done).map((each) => each.pose);

test("the wheel's change is told once, when it rests or when it has to be", () => {
  wheel();
  gestures.finish();
  expect(finals().map((each) => each.focal_px > 800)).toEqual([true]);
  vi.advanceTimersByTime(1000);
  expect(finals()).toHaveLength(1);
  wheel();
  vi.advanceTimersByTime(1000);
  expect(finals()).toHaveLength(2);
});

test("a drag that was ended is over until the object is taken anew", () => {
  pointer("pointerdown", 300);
  pointer("pointermove", 330);
  gestures.finish();
  const count = told.length;
  expect(finals()).toHaveLength(1);
  pointer("pointermove", 380);
  pointer("pointerup", 380);
  expect(told).toHaveLength(count);
  pointer("pointerdown", 300);
  pointer("pointermove", 330);
  expect(told).toHaveLength(count + 1);
});

test("while another object is on its way nothing is changed, then or later", () => {
  paused = true;
  wheel();
  pointer("pointerdown", 300);
  pointer("pointermove", 330);
  pointer("pointerup", 330);
  paused = false;
  vi.advanceTimersByTime(1000);
  expect(told).toEqual([]);
});
