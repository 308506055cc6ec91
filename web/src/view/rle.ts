/**
 * COCO's compressed run lengths, as src/cadpose/rle.py: columns from the top, background first; each run, less
 * the run two before it, in groups of five bits, lowest first, each in one character from "0" on.
 */
export interface Rle {
  /** Height, width. */
  size: [number, number];
  counts: string;
}

/** Most pixels that are decoded. */
const MAX_PIXELS = 100_000_000;

/** Of a row-major mask of width * height, 0 or not. */
export function encodeRle(mask: Uint8Array, width: number, height: number): Rle {
  if (mask.length !== width * height) {
    throw new Error(`a mask of ${width} x ${height} has ${width * height} values, not ${mask.length}`);
  }
  const runs: number[] = [];
  let value = 0;
  let run = 0;
  for (let x = 0; x < width; x++) {
    for (let at = x; at < mask.length; at += width) {
      const here = mask[at] ? 1 : 0;
      if (here !== value) {
        runs.push(run);
        run = 0;
        value = here;
      }
      run++;
    }
  }
  runs.push(run);
  return { size: [height, width], counts: textFromRuns(runs) };
}

/** Row-major mask of width * height, 0 or 1. Throws an Error where the runs do not make that mask. */
export function decodeRle(rle: Rle): Uint8Array {
  const [height, width] = rle.size;
  if (!(height >= 1 && width >= 1 && height * width <= MAX_PIXELS)) {
    throw new Error(`a mask of ${height} x ${width} pixels cannot be read`);
  }
  const mask = new Uint8Array(width * height);
  let at = 0;
  runsFromText(rle.counts).forEach((run, index) => {
    if (run < 0 || at + run > mask.length) throw new Error("a mask's runs do not fit its size");
    if (index % 2 === 1) {
      for (let i = at; i < at + run; i++) mask[(i % height) * width + Math.floor(i / height)] = 1;
    }
    at += run;
  });
  if (at !== mask.length) throw new Error("a mask's runs do not fill its size");
  return mask;
}

function textFromRuns(runs: readonly number[]): string {
  const codes: string[] = [];
  runs.forEach((run, index) => {
    let value = index > 2 ? run - runs[index - 2] : run;
    for (let more = true; more; ) {
      const group = value & 31;
      value >>= 5;
      // Done when what is left is the sign that bit 4 of the group tells.
      more = group & 16 ? value !== -1 : value !== 0;
      codes.push(String.fromCharCode(48 + group + (more ? 32 : 0)));
    }
  });
  return codes.join("");
}

function runsFromText(text: string): number[] {
  const runs: number[] = [];
  let value = 0;
  let shift = 0;
  for (let i = 0; i < text.length; i++) {
    const code = text.charCodeAt(i) - 48;
    if (code < 0 || code > 63 || shift > 25) throw new Error("a compressed mask holds what none may hold");
    // Not by shifts: six groups are above the 32 bits that those have.
    value += (code & 31) * 2 ** shift;
    shift += 5;
    if (code & 32) continue;
    if (code & 16) value -= 2 ** shift;
    runs.push(value + (runs.length > 2 ? runs[runs.length - 2] : 0));
    value = shift = 0;
  }
  if (shift) throw new Error("a compressed mask ends within a number");
  return runs;
}
