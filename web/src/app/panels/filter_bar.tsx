/** What the queue is narrowed to: words, category, verdict, confidence, who decided. */

import { useEffect, useState } from "preact/hooks";

import { useApp } from "../app_state";
import { type Filters, isNarrowed, NO_FILTERS, toggled, VERDICTS } from "../state/filters";

const TYPING_MS = 250;

export function FilterBar() {
  const { queue } = useApp().review;
  const filters = queue.filters.value;
  const [text, setText] = useState(filters.text);

  useEffect(() => setText(filters.text), [filters.text]);
  useEffect(() => {
    if (text === queue.filters.peek().text) return undefined;
    const timer = setTimeout(() => set({ text }), TYPING_MS);
    return () => clearTimeout(timer);
  }, [text]);

  function set(change: Partial<Filters>): void {
    void queue.narrow({ ...queue.filters.peek(), ...change });
  }

  return (
    <div class="filters">
      <label>
        Photo or model
        <input type="search" value={text} onInput={(event) => setText(event.currentTarget.value)} />
      </label>
      <label>
        Category
        <select value={filters.category} onChange={(event) => set({ category: event.currentTarget.value })}>
          <option value="">all</option>
          {queue.categories.value.map((category) => (
            <option key={category} value={category}>
              {category}
            </option>
          ))}
        </select>
      </label>
      <label>
        Decided by
        <select
          value={filters.decidedBy}
          onChange={(event) => set({ decidedBy: event.currentTarget.value as Filters["decidedBy"] })}
        >
          <option value="">anybody or nobody</option>
          <option value="human">a person</option>
          <option value="program">the program only</option>
        </select>
      </label>
      <fieldset class="chips">
        <legend>Verdict</legend>
        {VERDICTS.map(({ value, label }) => (
          <label key={value} class="chip">
            <input
              type="checkbox"
              checked={filters.verdicts.includes(value)}
              onChange={() => set({ verdicts: toggled(filters.verdicts, value) })}
            />
            <span>{label}</span>
          </label>
        ))}
      </fieldset>
      <fieldset class="between">
        <legend>Confidence, in %</legend>
        <Percent label="from" value={filters.least} onChange={(least) => set({ least })} />
        <Percent label="to" value={filters.most} onChange={(most) => set({ most })} />
      </fieldset>
      {isNarrowed(filters) && (
        <button type="button" onClick={() => void queue.narrow(NO_FILTERS)}>
          Show all
        </button>
      )}
    </div>
  );
}

function Percent({ label, value, onChange }: { label: string; value: number; onChange(share: number): void }) {
  return (
    <label>
      {label}
      <input
        type="number"
        min={0}
        max={100}
        step={5}
        value={Math.round(value * 100)}
        onChange={(event) => {
          const share = event.currentTarget.valueAsNumber / 100;
          if (Number.isFinite(share)) onChange(Math.min(1, Math.max(0, share)));
        }}
      />
    </label>
  );
}
