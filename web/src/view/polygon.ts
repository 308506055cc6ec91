/** Polygons of a mask: filled on the photo's pixels, traced from a mask, simplified. Continuous pixels. */
import type { Point } from "./camera";

export type Ring = [number, number][];

/**
 * Which pixels' centres lie inside: more turns one way than the other being odd, so that a ring within another
 * is a hole. Row-major, 0 or 1.
 */
export function filled(rings: readonly Ring[], width: number, height: number): Uint8Array {
  const mask = new Uint8Array(width * height);
  for (let row = 0; row < height; row++) {
    const y = row + 0.5;
    const crossings: number[] = [];
    for (const ring of rings) {
      for (let i = 0; i < ring.length; i++) {
        const [x0, y0] = ring[i];
        const [x1, y1] = ring[(i + 1) % ring.length];
        // Half-open: a corner on the row counts for one of its edges.
        if (y0 <= y !== y1 <= y) crossings.push(x0 + ((y - y0) * (x1 - x0)) / (y1 - y0));
      }
    }
    crossings.sort((a, b) => a - b);
    for (let i = 0; i + 1 < crossings.length; i += 2) {
      const first = Math.max(0, Math.ceil(crossings[i] - 0.5));
      const end = Math.min(width, Math.ceil(crossings[i + 1] - 0.5));
      if (first < end) mask.fill(1, row * width + first, row * width + end);
    }
  }
  return mask;
}

/**
 * The borders between 1 and 0 as rings along the pixels' edges, outer ones and holes: `filled` makes the same mask
 * of them. Pixels that touch at a corner only are apart.
 */
export function traced(mask: Uint8Array, width: number, height: number): Ring[] {
  const at = (x: number, y: number): number =>
    x >= 0 && y >= 0 && x < width && y < height && mask[y * width + x] ? 1 : 0;
  const stride = width + 1;
  // The steps from each corner, with what is inside on the right: 0 right, 1 down, 2 left, 3 up, as bits.
  const steps = new Uint8Array(stride * (height + 1));
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      if (!mask[y * width + x]) continue;
      if (!at(x, y - 1)) steps[y * stride + x] |= 1;
      if (!at(x + 1, y)) steps[y * stride + x + 1] |= 2;
      if (!at(x, y + 1)) steps[(y + 1) * stride + x + 1] |= 4;
      if (!at(x - 1, y)) steps[(y + 1) * stride + x] |= 8;
    }
  }
  const rings: Ring[] = [];
  const left = steps.slice();
  for (let start = 0; start < left.length; start++) {
    while (left[start]) {
      const first = Math.log2(left[start] & -left[start]);
      const ring: Ring = [];
      let [here, step, last] = [start, first, -1];
      do {
        left[here] &= ~(1 << step);
        if (step !== last) ring.push([here % stride, Math.floor(here / stride)]);
        here += [1, stride, -1, -stride][step];
        last = step;
        step = nextStep(steps[here], last);
      } while (here !== start || step !== first);
      rings.push(ring);
    }
  }
  return rings;
}

/** Right turns first: they keep pixels apart that meet at a corner. */
function nextStep(bits: number, last: number): number {
  for (const turn of [1, 0]) if (bits & (1 << (last + turn) % 4)) return (last + turn) % 4;
  return (last + 3) % 4;
}

/** The ring with fewer corners, none of those left out farther than `tolerance` away (Douglas and Peucker). */
export function simplified(ring: Ring, tolerance: number): Ring {
  if (ring.length < 4) return ring;
  // Two corners that are far apart stay, and the two halves between them are simplified.
  let far = 0;
  for (let i = 1; i < ring.length; i++) if (distance(ring[0], ring[i]) > distance(ring[0], ring[far])) far = i;
  const kept = new Uint8Array(ring.length + 1);
  kept[0] = kept[far] = 1;
  const open: [number, number][] = [
    [0, far],
    [far, ring.length],
  ];
  for (let part = open.pop(); part; part = open.pop()) {
    const [from, to] = part;
    let worst = -1;
    let most = tolerance;
    for (let i = from + 1; i < to; i++) {
      const away = distanceToSegment(ring[i], ring[from], ring[to % ring.length]);
      if (away > most) [worst, most] = [i, away];
    }
    if (worst < 0) continue;
    kept[worst] = 1;
    open.push([from, worst], [worst, to]);
  }
  return ring.filter((_, i) => kept[i]);
}

/** Twice the area is positive where the ring goes clockwise on the screen. */
export function area(ring: Ring): number {
  return ring.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = ring[(i + 1) % ring.length];
    return sum + (x * nextY - nextX * y) / 2;
  }, 0);
}

/** Rings to edit of a mask, small specks and holes left out. */
export function ringsOf(mask: Uint8Array, width: number, height: number): Ring[] {
  const rings = traced(mask, width, height);
  const largest = Math.max(0, ...rings.map((ring) => Math.abs(area(ring))));
  const tolerance = Math.max(0.75, Math.sqrt(largest) / 150);
  return rings
    .filter((ring) => Math.abs(area(ring)) >= Math.max(4, largest / 2000))
    .map((ring) => simplified(ring, tolerance))
    .filter((ring) => ring.length >= 3);
}

export function distance(a: Point, b: Point): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

export function distanceToSegment(p: Point, a: Point, b: Point): number {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const length = dx * dx + dy * dy;
  const t = length > 0 ? Math.min(1, Math.max(0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length)) : 0;
  return Math.hypot(p[0] - a[0] - t * dx, p[1] - a[1] - t * dy);
}

/** Box of the rings, cut off at the photo's edges; null of nothing. */
export function boxOf(rings: readonly Ring[], width: number, height: number): [number, number, number, number] | null {
  const points = rings.flat();
  if (!points.length) return null;
  const xs = points.map(([x]) => Math.min(Math.max(x, 0), width));
  const ys = points.map(([, y]) => Math.min(Math.max(y, 0), height));
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}
