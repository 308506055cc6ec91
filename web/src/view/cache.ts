/** What was loaded last, by its address; the oldest goes first, and what is still loading counts. */
export class Cache<T> {
  private readonly kept = new Map<string, Promise<T>>();

  constructor(
    private readonly most: number,
    private readonly load: (key: string) => Promise<T>,
    private readonly drop: (value: T) => void = () => {},
  ) {}

  get(key: string): Promise<T> {
    let found = this.kept.get(key);
    if (found) {
      this.kept.delete(key);
    } else {
      found = this.load(key);
      // A failure is told to who asked, and tried again by who asks next.
      found.catch(() => this.kept.get(key) === found && this.kept.delete(key));
    }
    this.kept.set(key, found);
    for (const [oldest, value] of this.kept) {
      if (this.kept.size <= this.most) break;
      this.kept.delete(oldest);
      value.then(this.drop, () => {});
    }
    return found;
  }

  clear(): void {
    for (const value of this.kept.values()) value.then(this.drop, () => {});
    this.kept.clear();
  }
}
