/** A list box of any length: only the rows in sight are in the page. */

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";

import { reveal, visible } from "../state/windowed";

interface Props {
  label: string;
  total: number;
  row: number;
  selected: number;
  /** Rows up to there are wanted. */
  onReach(end: number): void;
  onChoose(place: number): void;
  children(place: number): ComponentChildren;
  /** Handed the function that puts the focus on the list. */
  onReady?(focus: () => void): void;
}

const PAGE = 8;

export function VirtualList({ label, total, row, selected, onReach, onChoose, children, onReady }: Props) {
  const box = useRef<HTMLDivElement>(null);
  const [top, setTop] = useState(0);
  const [height, setHeight] = useState(600);
  const [active, setActive] = useState(selected);
  const span = visible(top, height, row, total);

  useLayoutEffect(() => {
    const element = box.current;
    if (!element) return undefined;
    const watch = new ResizeObserver(() => setHeight(element.clientHeight));
    watch.observe(element);
    onReady?.(() => element.focus());
    return () => watch.disconnect();
  }, []);

  useEffect(() => onReach(span.end), [span.end, total]);

  useLayoutEffect(() => {
    setActive(selected);
    show(selected);
  }, [selected]);

  function show(place: number): void {
    const element = box.current;
    if (element && place >= 0) element.scrollTop = reveal(place, element.scrollTop, element.clientHeight, row);
  }

  function onKeyDown(event: KeyboardEvent): void {
    const moves: Record<string, number> = { ArrowDown: 1, ArrowUp: -1, PageDown: PAGE, PageUp: -PAGE };
    let place = active;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key in moves) place = Math.min(total - 1, Math.max(0, active + (moves[event.key] ?? 0)));
    else if (event.key === "Home") place = 0;
    else if (event.key === "End") place = total - 1;
    else if (event.key === "Enter" || event.key === " ") onChoose(active);
    else return;
    event.preventDefault();
    event.stopPropagation();
    setActive(place);
    show(place);
  }

  const rows: ComponentChildren[] = [];
  for (let place = span.first; place < span.end; place++) {
    rows.push(
      <div
        key={place}
        id={`row-${place}`}
        class={place === active ? "row active" : "row"}
        role="option"
        aria-selected={place === selected}
        aria-posinset={place + 1}
        aria-setsize={total}
        style={{ transform: `translateY(${place * row}px)`, height: `${row}px` }}
        onClick={() => onChoose(place)}
      >
        {children(place)}
      </div>,
    );
  }

  return (
    <div
      ref={box}
      class="virtual-list"
      role="listbox"
      tabIndex={0}
      aria-label={label}
      aria-activedescendant={active >= span.first && active < span.end ? `row-${active}` : undefined}
      onScroll={(event) => setTop(event.currentTarget.scrollTop)}
      onKeyDown={onKeyDown}
    >
      <div class="virtual-sheet" role="presentation" style={{ height: `${total * row}px` }}>
        {rows}
      </div>
    </div>
  );
}
