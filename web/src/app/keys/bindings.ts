/** Every key of the page: one table, which the help shows and the matcher reads. */

export type Group = "Go" | "Decide" | "Turn" | "Model and rotation" | "Refine" | "Look" | "Draw" | "Page";

export type ActionId =
  | "next"
  | "previous"
  | "queue"
  | "accept"
  | "reject"
  | "skip"
  | "later"
  | "azimuth+"
  | "azimuth-"
  | "azimuth++"
  | "azimuth--"
  | "elevation+"
  | "elevation-"
  | "elevation++"
  | "elevation--"
  | "inplane+"
  | "inplane-"
  | "focal+"
  | "focal-"
  | "flip"
  | "twin"
  | "candidate"
  | "hypothesis"
  | "search"
  | "snap"
  | "snap-full"
  | "undo"
  | "redo"
  | "reset"
  | "display"
  | "display-back"
  | "opacity+"
  | "opacity-"
  | "wipe"
  | "photo"
  | "zoom"
  | "box"
  | "mask"
  | "help"
  | "upload"
  | "stats"
  | "export"
  | "replace"
  | "theme";

export interface Chord {
  /** `KeyboardEvent.key` in lower case, or a digit, which is matched by its place on the keyboard. */
  readonly key: string;
  readonly shift?: boolean;
  readonly alt?: boolean;
  readonly ctrl?: boolean;
}

export interface Binding {
  readonly id: ActionId;
  readonly chords: readonly Chord[];
  readonly what: string;
  readonly group: Group;
  /** "view": only while the photo has the focus. */
  readonly where: "page" | "view";
  /** How the help writes it, where the chords are too many. */
  readonly shown?: string;
}

const digits = (alt: boolean): Chord[] =>
  Array.from({ length: 9 }, (_, index) => ({ key: String(index + 1), ...(alt ? { alt } : {}) }));

export const BINDINGS: readonly Binding[] = [
  { id: "next", chords: [{ key: "j" }], what: "Next object", group: "Go", where: "page" },
  { id: "previous", chords: [{ key: "k" }], what: "Previous object", group: "Go", where: "page" },
  { id: "queue", chords: [{ key: "q" }], what: "To the queue (arrows move in it)", group: "Go", where: "page" },

  { id: "accept", chords: [{ key: "a" }], what: "Accept, with the changes if there are any", group: "Decide", where: "page" },
  { id: "accept", chords: [{ key: "enter" }], what: "The same, while the photo has the focus", group: "Decide", where: "view" },
  { id: "reject", chords: [{ key: "x" }], what: "Reject, then choose the reason by its digit", group: "Decide", where: "page" },
  { id: "skip", chords: [{ key: "n" }], what: "Skip", group: "Decide", where: "page" },
  { id: "later", chords: [{ key: "l" }], what: "Review later", group: "Decide", where: "page" },

  { id: "azimuth-", chords: [{ key: "arrowleft" }], what: "Azimuth −1°", group: "Turn", where: "view" },
  { id: "azimuth+", chords: [{ key: "arrowright" }], what: "Azimuth +1°", group: "Turn", where: "view" },
  { id: "azimuth--", chords: [{ key: "arrowleft", shift: true }], what: "Azimuth −10°", group: "Turn", where: "view" },
  { id: "azimuth++", chords: [{ key: "arrowright", shift: true }], what: "Azimuth +10°", group: "Turn", where: "view" },
  { id: "elevation+", chords: [{ key: "arrowup" }], what: "Elevation +1°", group: "Turn", where: "view" },
  { id: "elevation-", chords: [{ key: "arrowdown" }], what: "Elevation −1°", group: "Turn", where: "view" },
  { id: "elevation++", chords: [{ key: "arrowup", shift: true }], what: "Elevation +10°", group: "Turn", where: "view" },
  { id: "elevation--", chords: [{ key: "arrowdown", shift: true }], what: "Elevation −10°", group: "Turn", where: "view" },
  { id: "inplane-", chords: [{ key: "," }], what: "In-plane −1°", group: "Turn", where: "page" },
  { id: "inplane+", chords: [{ key: "." }], what: "In-plane +1°", group: "Turn", where: "page" },
  { id: "focal+", chords: [{ key: "+" }, { key: "=" }], what: "Focal length +1 %", group: "Turn", where: "page" },
  { id: "focal-", chords: [{ key: "-" }], what: "Focal length −1 %", group: "Turn", where: "page" },
  { id: "flip", chords: [{ key: "f" }], what: "Turn by 180°: front and back", group: "Turn", where: "page" },
  { id: "twin", chords: [{ key: "t" }], what: "Next rotation that looks alike", group: "Turn", where: "page" },

  { id: "candidate", chords: digits(false), what: "Candidate model 1 to 9", group: "Model and rotation", where: "page", shown: "1 – 9" },
  { id: "hypothesis", chords: digits(true), what: "Rotation hypothesis 1 to 9", group: "Model and rotation", where: "page", shown: "Alt + 1 – 9" },
  { id: "search", chords: [{ key: "/" }], what: "Search the library", group: "Model and rotation", where: "page" },

  { id: "snap", chords: [{ key: "s" }], what: "Snap: refine from here, fast", group: "Refine", where: "page" },
  { id: "snap-full", chords: [{ key: "s", shift: true }], what: "Snap, thoroughly", group: "Refine", where: "page" },
  { id: "undo", chords: [{ key: "z", ctrl: true }], what: "Undo", group: "Refine", where: "page" },
  { id: "redo", chords: [{ key: "z", ctrl: true, shift: true }, { key: "y", ctrl: true }], what: "Redo", group: "Refine", where: "page" },
  { id: "reset", chords: [{ key: "r" }], what: "Back to what is stored", group: "Refine", where: "page" },

  { id: "display", chords: [{ key: "v" }], what: "Next way to show the model", group: "Look", where: "page" },
  { id: "display-back", chords: [{ key: "v", shift: true }], what: "Way before", group: "Look", where: "page" },
  { id: "opacity-", chords: [{ key: "[" }], what: "Model fainter", group: "Look", where: "page" },
  { id: "opacity+", chords: [{ key: "]" }], what: "Model stronger", group: "Look", where: "page" },
  { id: "wipe", chords: [{ key: "w" }], what: "Wipe between before and now", group: "Look", where: "page" },
  { id: "photo", chords: [{ key: "p" }], what: "Photo alone, and back", group: "Look", where: "page" },
  { id: "zoom", chords: [{ key: "o" }], what: "Zoom to the object, and back", group: "Look", where: "page" },

  { id: "box", chords: [{ key: "b" }], what: "Fix the box; again to end", group: "Draw", where: "page" },
  { id: "mask", chords: [{ key: "m" }], what: "Draw the mask; again to end", group: "Draw", where: "page" },

  { id: "help", chords: [{ key: "?" }], what: "This list", group: "Page", where: "page" },
  { id: "upload", chords: [{ key: "u" }], what: "Add photos", group: "Page", where: "page" },
  { id: "stats", chords: [{ key: "i" }], what: "Statistics", group: "Page", where: "page" },
  { id: "export", chords: [{ key: "e" }], what: "Export", group: "Page", where: "page" },
  { id: "replace", chords: [{ key: "g" }], what: "Replace the object in the photo", group: "Page", where: "page" },
  { id: "theme", chords: [{ key: "d" }], what: "Light, dark, as the system", group: "Page", where: "page" },
];

/** What goes on while its key is held; all else happens once a press. */
export const REPEATING: ReadonlySet<ActionId> = new Set<ActionId>([
  "next",
  "previous",
  "azimuth+",
  "azimuth-",
  "azimuth++",
  "azimuth--",
  "elevation+",
  "elevation-",
  "elevation++",
  "elevation--",
  "inplane+",
  "inplane-",
  "focal+",
  "focal-",
  "opacity+",
  "opacity-",
]);

const NAMES: Record<string, string> = {
  arrowleft: "←",
  arrowright: "→",
  arrowup: "↑",
  arrowdown: "↓",
  enter: "Enter",
};

export function chordText(chord: Chord): string {
  const name = NAMES[chord.key] ?? (chord.key.length === 1 ? chord.key.toUpperCase() : chord.key);
  return [chord.ctrl && "Ctrl", chord.alt && "Alt", chord.shift && "Shift", name].filter(Boolean).join(" + ");
}

export function bindingText(binding: Binding): string {
  return binding.shown ?? binding.chords.map(chordText).join(" or ");
}

/** "A" for the button that does the same. */
export function keyOf(id: ActionId): string {
  const binding = BINDINGS.find((each) => each.id === id);
  return binding ? bindingText(binding) : "";
}
