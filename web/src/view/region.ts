/** A box and a mask being edited, with what was before. Everything in pixels of the photo. */
import type { Point } from "./camera";
import { boxOf, distance, distanceToSegment, filled, type Ring, ringsOf } from "./polygon";
import type { Box } from "./pose";

export const BOX_HANDLES = ["nw", "n", "ne", "e", "se", "s", "sw", "w"] as const;
export type BoxHandle = (typeof BOX_HANDLES)[number];

interface State {
  box: Box | null;
  rings: Ring[];
  /** What the rings were traced from or are filled to; null of no mask. */
  mask: Uint8Array | null;
}

/** Shorter sides than this, in pixels, are no box. */
const LEAST_BOX = 2;
const MOST_STEPS = 100;

export class Region {
  private state: State = { box: null, rings: [], mask: null };
  private readonly past: State[] = [];
  private readonly future: State[] = [];

  constructor(
    readonly width: number,
    readonly height: number,
  ) {}

  get box(): Box | null {
    return this.state.box;
  }

  get rings(): readonly Ring[] {
    return this.state.rings;
  }

  get mask(): Uint8Array | null {
    return this.state.mask;
  }

  /** Start from these; there is nothing to undo then. */
  reset(box: Box | null, mask: Uint8Array | null): void {
    this.past.length = this.future.length = 0;
    this.state = { box, mask, rings: mask ? ringsOf(mask, this.width, this.height) : [] };
  }

  /** Keep what is now, before a change. */
  mark(): void {
    this.past.push(copied(this.state));
    if (this.past.length > MOST_STEPS) this.past.shift();
    this.future.length = 0;
  }

  undo(): boolean {
    return this.go(this.past, this.future);
  }

  redo(): boolean {
    return this.go(this.future, this.past);
  }

  /** Between two corners, in any order; what is too small is no box. */
  drawBox(a: Point, b: Point): void {
    const box = this.inside([Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])]);
    if (box[2] - box[0] >= LEAST_BOX && box[3] - box[1] >= LEAST_BOX) this.state.box = box;
  }

  /** A handle goes to a point; it does not pass the other side. */
  dragBox(handle: BoxHandle, [x, y]: Point): void {
    if (!this.state.box) return;
    const box: Box = [...this.state.box];
    if (handle.includes("w")) box[0] = Math.min(x, box[2] - LEAST_BOX);
    if (handle.includes("e")) box[2] = Math.max(x, box[0] + LEAST_BOX);
    if (handle.includes("n")) box[1] = Math.min(y, box[3] - LEAST_BOX);
    if (handle.includes("s")) box[3] = Math.max(y, box[1] + LEAST_BOX);
    this.state.box = this.inside(box);
  }

  /** The whole box, as far as the photo goes. */
  shiftBox(dx: number, dy: number): void {
    const { box } = this.state;
    if (!box) return;
    const x = Math.min(Math.max(dx, -box[0]), this.width - box[2]);
    const y = Math.min(Math.max(dy, -box[1]), this.height - box[3]);
    this.state.box = [box[0] + x, box[1] + y, box[2] + x, box[3] + y];
  }

  /** Where a handle of the box is. */
  handleAt(handle: BoxHandle): [number, number] | null {
    const { box } = this.state;
    if (!box) return null;
    const x = handle.includes("w") ? box[0] : handle.includes("e") ? box[2] : (box[0] + box[2]) / 2;
    const y = handle.includes("n") ? box[1] : handle.includes("s") ? box[3] : (box[1] + box[3]) / 2;
    return [x, y];
  }

  /** A further ring, of at least three points. */
  addRing(points: Ring): void {
    if (points.length < 3) return;
    this.state.rings.push(points.map((point) => this.kept(point)));
    this.fill();
  }

  movePoint(ring: number, index: number, point: Point): void {
    this.state.rings[ring][index] = this.kept(point);
    this.fill();
  }

  /** On the edge from that point to the next one; its index. */
  insertPoint(ring: number, after: number, point: Point): number {
    this.state.rings[ring].splice(after + 1, 0, this.kept(point));
    this.fill();
    return after + 1;
  }

  /** A ring of less than three points goes as a whole. */
  deletePoint(ring: number, index: number): void {
    const { rings } = this.state;
    rings[ring].splice(index, 1);
    if (rings[ring].length < 3) rings.splice(ring, 1);
    this.fill();
  }

  /** The edge nearest to a point, no farther than `most`. */
  nearestEdge(point: Point, most: number): { ring: number; after: number } | null {
    let found: { ring: number; after: number } | null = null;
    this.state.rings.forEach((ring, number) => {
      ring.forEach((from, after) => {
        const away = distanceToSegment(point, from, ring[(after + 1) % ring.length]);
        if (away <= most) [most, found] = [away, { ring: number, after }];
      });
    });
    return found;
  }

  /** Set or clear the pixels about a stroke; `endStroke` makes polygons of what is left. */
  brush(from: Point, to: Point, radius: number, value: 0 | 1): void {
    const mask = (this.state.mask ??= new Uint8Array(this.width * this.height));
    const [x0, x1] = [Math.min(from[0], to[0]) - radius, Math.max(from[0], to[0]) + radius];
    const [y0, y1] = [Math.min(from[1], to[1]) - radius, Math.max(from[1], to[1]) + radius];
    for (let y = Math.max(0, Math.floor(y0)); y < Math.min(this.height, Math.ceil(y1)); y++) {
      for (let x = Math.max(0, Math.floor(x0)); x < Math.min(this.width, Math.ceil(x1)); x++) {
        if (distanceToSegment([x + 0.5, y + 0.5], from, to) <= radius) mask[y * this.width + x] = value;
      }
    }
  }

  endStroke(): void {
    const { mask } = this.state;
    if (!mask) return;
    this.state.rings = ringsOf(mask, this.width, this.height);
    if (!mask.includes(1)) this.state.mask = null;
    this.boxFromMask();
  }

  private fill(): void {
    const { rings } = this.state;
    this.state.mask = rings.length ? filled(rings, this.width, this.height) : null;
    this.boxFromMask();
  }

  /** A mask alone has the box about it. */
  private boxFromMask(): void {
    if (!this.state.box) this.state.box = boxOf(this.state.rings, this.width, this.height);
  }

  private kept([x, y]: Point): [number, number] {
    return [Math.min(Math.max(x, 0), this.width), Math.min(Math.max(y, 0), this.height)];
  }

  private inside([x0, y0, x1, y1]: Box): Box {
    return [...this.kept([x0, y0]), ...this.kept([x1, y1])];
  }

  private go(from: State[], to: State[]): boolean {
    const state = from.pop();
    if (!state) return false;
    to.push(this.state);
    this.state = state;
    return true;
  }
}

/** Whether a click ends a ring that is being drawn: on its first point. */
export function closesRing(ring: Ring, point: Point, reach: number): boolean {
  return ring.length >= 3 && distance(ring[0], point) <= reach;
}

function copied({ box, rings, mask }: State): State {
  return {
    box: box ? [...box] : null,
    rings: rings.map((ring) => ring.map(([x, y]): [number, number] => [x, y])),
    mask: mask ? mask.slice() : null,
  };
}
