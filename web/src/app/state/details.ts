/** Details of items, fetched ahead of need and kept for a while. */

import type { Detail } from "../api/types";

export interface Loading {
  detail(id: string): Promise<Detail>;
  /** Brings a picture or a mesh into the browser's cache. */
  warm(detail: Detail): void;
}

const KEPT = 40;

export class Details {
  private readonly kept = new Map<string, Promise<Detail>>();
  private readonly since = new Map<string, number>();

  constructor(
    private readonly loading: Loading,
    private readonly now: () => number = () => Date.now(),
  ) {}

  get(id: string): Promise<Detail> {
    const found = this.kept.get(id);
    if (found) {
      // The last used is the last to go.
      this.kept.delete(id);
      this.kept.set(id, found);
      return found;
    }
    const detail = this.loading.detail(id);
    this.kept.set(id, detail);
    this.since.set(id, this.now());
    detail.catch(() => {
      if (this.kept.get(id) === detail) this.forget(id);
    });
    for (const oldest of this.kept.keys()) {
      if (this.kept.size <= KEPT) break;
      this.forget(oldest);
    }
    return detail;
  }

  /** Milliseconds since it was asked for. */
  age(id: string): number {
    const since = this.since.get(id);
    return since === undefined ? 0 : this.now() - since;
  }

  fresh(id: string): Promise<Detail> {
    this.forget(id);
    return this.get(id);
  }

  forget(id: string): void {
    this.kept.delete(id);
    this.since.delete(id);
  }

  async ahead(ids: readonly string[]): Promise<void> {
    for (const id of ids) {
      try {
        this.loading.warm(await this.get(id));
      } catch {
        // Told when the item is opened.
      }
    }
  }
}
