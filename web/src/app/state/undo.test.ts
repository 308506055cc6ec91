import { expect, test } from "vitest";

import { Undo } from "./undo";

test("goes back and forth, and a new state ends the way forth", () => {
  const undo = new Undo(0);
  undo.push(1);
  undo.push(2);
  undo.undo();
  expect(undo.present).toBe(1);
  undo.redo();
  expect(undo.present).toBe(2);
  undo.undo();
  undo.push(3);
  expect(undo.canRedo).toBe(false);
  undo.undo();
  undo.undo();
  expect([undo.present, undo.canUndo, undo.undo()]).toEqual([0, false, false]);
});

test("a run of like steps is one, until there is a pause or another kind", () => {
  let now = 0;
  const undo = new Undo(0, 200, 900, () => now);
  undo.push(1, "turn");
  undo.push(2, "turn");
  now = 2000;
  undo.push(3, "turn");
  undo.push(4, "zoom");
  const seen = [undo.present];
  while (undo.undo()) seen.push(undo.present);
  expect(seen).toEqual([4, 3, 2, 0]);
});

test("a step after an undo is a step of its own", () => {
  const undo = new Undo(0);
  undo.push(1, "turn");
  undo.push(2, "other");
  undo.undo();
  undo.push(5, "turn");
  undo.undo();
  expect(undo.present).toBe(1);
});

test("its depth has an end", () => {
  const undo = new Undo(0, 3);
  for (let state = 1; state <= 10; state++) undo.push(state);
  let steps = 0;
  while (undo.undo()) steps++;
  expect([steps, undo.present]).toEqual([3, 7]);
});
