/** States one can go back and forth between; a run of like changes counts as one. */

export class Undo<T> {
  private past: T[] = [];
  private future: T[] = [];
  private tag = "";
  private at = 0;

  constructor(
    private state: T,
    private readonly depth = 200,
    private readonly quietMs = 900,
    private readonly now: () => number = () => Date.now(),
  ) {}

  get present(): T {
    return this.state;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** A new state. With the tag of the last one, shortly after it, it takes that one's place. */
  push(state: T, tag = ""): void {
    const now = this.now();
    const joins = tag !== "" && tag === this.tag && now - this.at < this.quietMs && this.past.length > 0;
    if (!joins) {
      this.past.push(this.state);
      if (this.past.length > this.depth) this.past.shift();
    }
    this.state = state;
    this.future = [];
    this.tag = tag;
    this.at = now;
  }

  undo(): boolean {
    const before = this.past.pop();
    if (before === undefined) return false;
    this.future.push(this.state);
    this.state = before;
    this.tag = "";
    return true;
  }

  redo(): boolean {
    const after = this.future.pop();
    if (after === undefined) return false;
    this.past.push(this.state);
    this.state = after;
    this.tag = "";
    return true;
  }

  /** Puts a state where redo finds it, for example what another person's word pushed aside. */
  keepForRedo(state: T): void {
    this.future = [state];
    this.tag = "";
  }
}
