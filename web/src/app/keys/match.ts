/** From a key press to what it does, and when it does nothing. */

import { type ActionId, BINDINGS, type Binding, type Chord } from "./bindings";

export interface Press {
  key: string;
  code: string;
  shiftKey: boolean;
  altKey: boolean;
  ctrlKey: boolean;
  metaKey: boolean;
}

export interface Pressed {
  id: ActionId;
  /** Which of 1 to 9, else 0. */
  digit: number;
}

// These are typed with Shift on some keyboards and without on others.
const SIGNS = new Set([",", ".", "+", "-", "=", "/", "?", "[", "]"]);

function fits(chord: Chord, press: Press): boolean {
  const ctrl = press.ctrlKey || press.metaKey;
  if (ctrl !== (chord.ctrl ?? false)) return false;
  if (/^[1-9]$/.test(chord.key)) {
    if (press.altKey !== (chord.alt ?? false) || press.shiftKey) return false;
    // With Alt some systems write another sign; the numeric pad is fine as well.
    return press.key === chord.key || press.code === `Digit${chord.key}`;
  }
  const key = press.key.toLowerCase();
  if (key !== chord.key) return false;
  // "[" needs AltGr on many keyboards, which Windows tells as Ctrl+Alt: those have the buttons.
  if (press.altKey !== (chord.alt ?? false)) return false;
  return SIGNS.has(chord.key) || press.shiftKey === (chord.shift ?? false);
}

export function match(press: Press, inView: boolean, bindings: readonly Binding[] = BINDINGS): Pressed | null {
  for (const binding of bindings) {
    if (binding.where === "view" && !inView) continue;
    const chord = binding.chords.find((each) => fits(each, press));
    if (chord) return { id: binding.id, digit: /^[1-9]$/.test(chord.key) ? Number(chord.key) : 0 };
  }
  return null;
}

const TYPED = new Set(["text", "search", "number", "email", "url", "password", "tel"]);

/** Whether a key there is for writing, and for nothing else. */
export function isWriting(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.isContentEditable || target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement) {
    return true;
  }
  return target instanceof HTMLInputElement && TYPED.has(target.type);
}

/** Whether the key belongs to the control that has the focus: arrows move sliders, lists and tabs. */
export function isTaken(press: Press, target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  const arrow = press.key.startsWith("Arrow");
  if (target instanceof HTMLInputElement) return arrow || (target.type !== "range" && press.key === " ");
  const role = target.getAttribute("role");
  return (arrow || press.key === "Enter") && (role === "listbox" || role === "tab" || role === "separator");
}
