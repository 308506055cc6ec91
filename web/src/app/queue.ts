/** The queue as signals: which pages are here, what it is narrowed to, what comes next. */

import { signal } from "@preact/signals";

import { type Api, isAbort, sentence } from "./api/client";
import type { Item } from "./api/types";
import { type Filters, NO_FILTERS, categoriesOf, filterQuery, isNarrowed } from "./state/filters";
import { Pages, nextOpen } from "./state/pages";

const AHEAD = 3;

const isOpen = (item: Item): boolean => item.decided_by !== "human";

export class Queue {
  readonly filters = signal<Filters>(NO_FILTERS);
  /** Raised whenever the pages change. */
  readonly tick = signal(0);
  readonly error = signal("");
  readonly loading = signal(false);
  readonly categories = signal<string[]>([]);
  private pages: Pages;
  private coming: Pages | null = null;

  constructor(private readonly api: Pick<Api, "queue">) {
    this.pages = this.fresh();
  }

  get total(): number {
    return this.tick.value >= 0 ? this.pages.total : 0;
  }

  get loaded(): boolean {
    return this.tick.value >= 0 && this.pages.loaded;
  }

  /** Whether the store holds nothing at all, as far as this list can tell. */
  get empty(): boolean {
    return this.loaded && this.total === 0 && !isNarrowed(this.filters.value);
  }

  at(place: number): Item | undefined {
    return this.tick.value >= 0 ? this.pages.items[place] : undefined;
  }

  item(id: string): Item | undefined {
    return this.at(this.pages.indexOf(id));
  }

  indexOf(id: string | null): number {
    return id !== null && this.tick.value >= 0 ? this.pages.indexOf(id) : -1;
  }

  /** Fetches the list anew, as far as it was known. */
  async reload(): Promise<void> {
    await this.restart(Math.max(1, this.pages.items.length));
  }

  async narrow(filters: Filters): Promise<void> {
    this.filters.value = filters;
    await this.restart(1);
  }

  /** The former list stays until the first page of the new one is there. */
  private async restart(count: number): Promise<void> {
    this.coming?.stop();
    const pages = this.fresh();
    this.coming = pages;
    this.loading.value = true;
    try {
      await pages.ensure(count);
      if (this.coming !== pages) return;
      this.pages.stop();
      this.pages = pages;
      this.coming = null;
      this.error.value = "";
      this.gather();
      this.tick.value++;
    } catch (error) {
      if (this.coming === pages && !isAbort(error)) this.error.value = sentence(error);
    } finally {
      if (this.pages === pages || this.coming === pages) this.loading.value = false;
    }
  }

  private gather(): void {
    const known = this.categories.peek();
    const found = new Set([...known, ...categoriesOf(this.pages.items)]);
    if (found.size !== known.length) this.categories.value = [...found].sort();
  }

  async ensure(count: number): Promise<void> {
    const pages = this.pages;
    this.loading.value = true;
    try {
      await pages.ensure(count);
      if (pages === this.pages) this.error.value = "";
    } catch (error) {
      if (pages === this.pages && !isAbort(error)) this.error.value = sentence(error);
    } finally {
      if (pages === this.pages) this.loading.value = false;
    }
  }

  update(item: Item): void {
    this.pages.update(item);
  }

  firstOpen(): Item | undefined {
    return this.pages.items[nextOpen(this.pages.items, -1)] ?? this.pages.items[0];
  }

  /** The item after or before; fetches on where the queue does, and gives none at its ends or after an error. */
  async neighbour(id: string | null, by: 1 | -1): Promise<Item | undefined> {
    for (;;) {
      const pages = this.pages;
      const place = this.indexOf(id);
      const found = pages.items[place + by];
      if (by < 0) return found;
      const more = pages.complete ? null : this.ensure(place + 2 + AHEAD);
      if (found || !more) return found;
      await more;
      if (pages === this.pages && this.error.peek()) return undefined;
    }
  }

  /** The next item on which no person has decided, from the top again after the last; fetches on as it must. */
  async nextOpen(id: string | null): Promise<Item | undefined> {
    const place = id === null ? -1 : this.pages.indexOf(id);
    for (;;) {
      const items = this.pages.items;
      const next = nextOpen(items, place);
      if (next >= 0) return items[next];
      if (this.pages.complete || this.error.peek()) return items.find((item) => isOpen(item) && item.id !== id);
      await this.ensure(items.length + 1);
    }
  }

  /** The ids to fetch ahead when one is open: the next ones, and the one before. */
  around(id: string): string[] {
    const place = this.pages.indexOf(id);
    const near = [1, 2, 3, -1].map((by) => this.pages.items[place + by]?.id);
    return place < 0 ? [] : near.filter((each) => each !== undefined);
  }

  private fresh(): Pages {
    const query = filterQuery(this.filters.peek());
    const pages: Pages = new Pages(
      (after, limit, calling) => this.api.queue({ ...query, after, limit }, calling),
      () => {
        if (pages !== this.pages) return;
        this.gather();
        this.tick.value++;
      },
    );
    return pages;
  }
}
