// @vitest-environment happy-dom
import { expect, test } from "vitest";

import { BINDINGS, chordText } from "./bindings";
import { isTaken, isWriting, match, type Press } from "./match";

function press(key: string, change: Partial<Press> = {}): Press {
  return { key, code: "", shiftKey: false, altKey: false, ctrlKey: false, metaKey: false, ...change };
}

test("no key is bound twice", () => {
  const seen = BINDINGS.flatMap((binding) => binding.chords.map(chordText));
  expect(seen.filter((text, place) => seen.indexOf(text) !== place)).toEqual([]);
});

test("every press finds the one binding that it is written for", () => {
  for (const binding of BINDINGS) {
    for (const chord of binding.chords) {
      const found = match(
        press(chord.shift ? chord.key.toUpperCase() : chord.key, {
          shiftKey: chord.shift ?? false,
          altKey: chord.alt ?? false,
          ctrlKey: chord.ctrl ?? false,
        }),
        true,
      );
      expect([chordText(chord), found?.id]).toEqual([chordText(chord), binding.id]);
    }
  }
});

test("digits choose candidates, with Alt hypotheses, whatever sign Alt makes of them", () => {
  expect(match(press("3", { code: "Digit3" }), false)).toEqual({ id: "candidate", digit: 3 });
  expect(match(press("£", { code: "Digit3", altKey: true }), false)).toEqual({ id: "hypothesis", digit: 3 });
});

test("signs may need Shift, letters with it are others", () => {
  expect(match(press("?", { shiftKey: true }), false)?.id).toBe("help");
  expect(match(press("/", { shiftKey: true }), false)?.id).toBe("search");
  expect(match(press("S", { shiftKey: true }), false)?.id).toBe("snap-full");
  expect(match(press("A", { shiftKey: true }), false)).toBeNull();
});

test("the browser's own keys are left to it", () => {
  for (const key of ["a", "s", "r", "f", "l", "n", "1"]) expect(match(press(key, { ctrlKey: true }), true)).toBeNull();
  expect(match(press("z", { metaKey: true }), true)?.id).toBe("undo");
});

test("arrows and Enter are for the photo only", () => {
  expect(match(press("ArrowLeft"), false)).toBeNull();
  expect(match(press("ArrowLeft"), true)?.id).toBe("azimuth-");
  expect(match(press("Enter"), false)).toBeNull();
});

test("keys rest where somebody writes, and arrows where a control has them", () => {
  const made = (html: string): Element => {
    document.body.innerHTML = html;
    const found = document.body.firstElementChild;
    if (!found) throw new Error("nothing made");
    return found;
  };
  for (const html of ["<input>", "<input type=number>", "<textarea></textarea>", "<select></select>"]) {
    expect(isWriting(made(html))).toBe(true);
  }
  for (const html of ["<button>b</button>", "<input type=range>", "<input type=checkbox>", "<div></div>"]) {
    expect(isWriting(made(html))).toBe(false);
  }
  expect(isTaken(press("ArrowLeft"), made("<input type=range>"))).toBe(true);
  expect(isTaken(press("s"), made("<input type=range>"))).toBe(false);
  expect(isTaken(press("ArrowDown"), made("<div role=listbox></div>"))).toBe(true);
  expect(isTaken(press("j"), made("<div role=listbox></div>"))).toBe(false);
});
