/** Which rows of a long list are in sight. */

export interface Span {
  first: number;
  /** One past the last. */
  end: number;
}

export function visible(top: number, height: number, row: number, total: number, beyond = 6): Span {
  const first = Math.max(0, Math.floor(top / row) - beyond);
  const end = Math.min(total, Math.ceil((top + height) / row) + beyond);
  return { first: Math.min(first, end), end };
}

/** Where to scroll to so that a row is seen whole; the present place if it is already. */
export function reveal(index: number, top: number, height: number, row: number): number {
  const start = index * row;
  if (start < top) return start;
  if (start + row > top + height) return start + row - height;
  return top;
}
