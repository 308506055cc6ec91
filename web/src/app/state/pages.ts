/** The queue as a list by place; its pages come from the server as they are needed. */

import type { Item, ItemPage } from "../api/types";

export type FetchPage = (after: string | null, limit: number, signal: AbortSignal) => Promise<ItemPage>;

const NEAR = 100;
const FAR = 500;

export class Pages {
  readonly items: Item[] = [];
  total = 0;
  loaded = false;
  private readonly places = new Map<string, number>();
  private after: string | null = null;
  private wanted = 0;
  private running: Promise<void> | null = null;
  private readonly calling = new AbortController();

  constructor(
    private readonly fetchPage: FetchPage,
    private readonly changed: () => void = () => undefined,
  ) {}

  get complete(): boolean {
    return this.loaded && this.after === null;
  }

  /** Fetches on until the first `count` places are known, or the queue ends. */
  ensure(count: number): Promise<void> {
    this.wanted = Math.max(this.wanted, count);
    if (this.running === null) {
      this.running = this.fill().finally(() => {
        this.running = null;
      });
    }
    return this.running;
  }

  /** Lets nothing more arrive. */
  stop(): void {
    this.calling.abort();
  }

  indexOf(id: string): number {
    return this.places.get(id) ?? -1;
  }

  /** A decided item keeps its place, so that one can go back to it. */
  update(item: Item): void {
    const place = this.places.get(item.id);
    if (place === undefined) return;
    this.items[place] = item;
    this.changed();
  }

  private async fill(): Promise<void> {
    while (!this.complete && (!this.loaded || this.items.length < this.wanted)) {
      const limit = this.wanted - this.items.length > 3 * NEAR ? FAR : NEAR;
      const page = await this.fetchPage(this.after, limit, this.calling.signal);
      if (this.calling.signal.aborted) return;
      for (const item of page.items) {
        if (this.places.has(item.id)) continue;
        this.places.set(item.id, this.items.length);
        this.items.push(item);
      }
      this.after = page.items.length > 0 ? page.after : null;
      this.total = Math.max(page.total, this.items.length);
      if (this.after === null) this.total = this.items.length;
      this.loaded = true;
      this.changed();
    }
  }
}

/** The next place on which no person has decided, else -1. */
export function nextOpen(items: readonly Item[], from: number): number {
  for (let place = from + 1; place < items.length; place++) {
    if (items[place]?.decided_by !== "human") return place;
  }
  return -1;
}
