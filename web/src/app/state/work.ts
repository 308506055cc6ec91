/** Drafts of all items that were touched, each with its undo history, while the page is open. */

import type { Detail, Region } from "../api/types";
import { type Draft, detectedOf, draftOf, isChanged } from "./draft";
import { Undo } from "./undo";

export interface Work {
  readonly base: Draft;
  /** Box and mask that a draft without a region of its own stands on. */
  readonly detected: Region;
  /** Of the annotation that this began from; the next decision tells it. */
  version: number;
  readonly undo: Undo<Draft>;
}

export class Desk {
  private readonly works = new Map<string, Work>();

  /** The item's work; begun anew unless there is one with changes in it. */
  open(detail: Detail): Work {
    const found = this.works.get(detail.id);
    if (found && (found.version === detail.version || isChanged(found.base, found.undo.present))) return found;
    return this.begin(detail);
  }

  begin(detail: Detail): Work {
    const base = draftOf(detail);
    const work: Work = { base, detected: detectedOf(detail), version: detail.version, undo: new Undo(base) };
    this.works.set(detail.id, work);
    return work;
  }

  /** Takes what is stored now for the base; what was on the desk is one redo away. */
  rebase(detail: Detail): Work {
    const mine = this.works.get(detail.id)?.undo.present;
    const work = this.begin(detail);
    if (mine && isChanged(work.base, mine)) work.undo.keepForRedo(mine);
    return work;
  }

  get(id: string): Work | undefined {
    return this.works.get(id);
  }

  /** After a decision of one's own that left the draft as it was. */
  restamp(id: string, version: number): void {
    const work = this.works.get(id);
    if (work) work.version = version;
  }

  drop(id: string): void {
    this.works.delete(id);
  }

  isDirty(id: string): boolean {
    const work = this.works.get(id);
    return work !== undefined && isChanged(work.base, work.undo.present);
  }

  dirty(): string[] {
    return [...this.works.keys()].filter((id) => this.isDirty(id));
  }
}
