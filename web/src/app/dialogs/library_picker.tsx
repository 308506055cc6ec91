/** The library as pictures, narrowed by name and category. */

import { useEffect, useRef, useState } from "preact/hooks";

import { isAbort, sentence } from "../api/client";
import { thumbUrl } from "../api/thumbs";
import type { Cad, Rotation } from "../api/types";
import { useApp } from "../app_state";
import { Thumb } from "../ui/thumb";

const PAGE = 48;
const TYPING_MS = 200;

interface Props {
  category: string;
  rotation: Rotation;
  chosen: string;
  onChoose(cad: Cad): void;
}

export function LibraryPicker({ category: first, rotation, chosen, onChoose }: Props) {
  const { api, review } = useApp();
  const library = review.session.value?.library ?? null;
  const known = library?.categories ?? {};
  const [category, setCategory] = useState(first in known ? first : "");
  const [text, setText] = useState("");
  const [items, setItems] = useState<Cad[]>([]);
  const [after, setAfter] = useState<string | null>(null);
  const [trouble, setTrouble] = useState("");
  const [loading, setLoading] = useState(true);
  const calling = useRef<AbortController | null>(null);

  async function load(from: string | null): Promise<void> {
    calling.current?.abort();
    const controller = new AbortController();
    calling.current = controller;
    setLoading(true);
    try {
      const page = await api.cads({ category, text: text.trim(), limit: PAGE, after: from }, controller.signal);
      setItems((before) => (from === null ? page.items : [...before, ...page.items]));
      setAfter(page.after);
      setTrouble("");
    } catch (error) {
      if (isAbort(error)) return;
      setTrouble(sentence(error));
    }
    setLoading(false);
  }

  useEffect(() => {
    if (!library) return undefined;
    const timer = setTimeout(() => void load(null), text ? TYPING_MS : 0);
    return () => {
      clearTimeout(timer);
      calling.current?.abort();
    };
  }, [category, text]);

  if (!library) return <NoLibrary />;
  return (
    <div class="picker">
      <div class="picker-bar">
        <label>
          Name
          <input
            type="text"
            data-first
            autocomplete="off"
            value={text}
            onInput={(event) => setText(event.currentTarget.value)}
            onKeyDown={(event) => {
              const best = items.find((each) => each.available);
              if (event.key !== "Enter" || !best) return;
              event.preventDefault();
              onChoose(best);
            }}
          />
        </label>
        <label>
          Category
          <select value={category} onChange={(event) => setCategory(event.currentTarget.value)}>
            <option value="">all ({library.models})</option>
            {Object.entries(known).map(([name, count]) => (
              <option key={name} value={name}>
                {name} ({count})
              </option>
            ))}
          </select>
        </label>
      </div>
      {trouble && (
        <p class="problem" role="alert">
          {trouble}{" "}
          <button type="button" onClick={() => void load(null)}>
            Try again
          </button>
        </p>
      )}
      {!loading && !trouble && items.length === 0 && <p class="hint">No model of the library fits.</p>}
      <ul class="models" aria-label="Models" aria-busy={loading}>
        {items.map((cad) => (
          <li key={cad.id}>
            <button
              type="button"
              class="model"
              aria-pressed={cad.id === chosen}
              disabled={!cad.available}
              title={[cad.name, cad.creator, cad.licence].filter(Boolean).join(" · ")}
              onClick={() => onChoose(cad)}
            >
              <Thumb url={cad.available ? thumbUrl(cad.key, rotation, 128) : null} size={96} instead={cad.name} lazy />
              <span class="tile-name">{cad.name}</span>
              <span class="tile-note">{cad.category}</span>
            </button>
          </li>
        ))}
      </ul>
      {after !== null && (
        <button type="button" class="command" disabled={loading} onClick={() => void load(after)}>
          More
        </button>
      )}
    </div>
  );
}

export function NoLibrary() {
  return (
    <div class="hint">
      <p>No CAD library is open. Import one and start the page with it:</p>
      <pre>
        cadpose library add sweethome3d{"\n"}cadpose review --store URL --library DIR
      </pre>
    </div>
  );
}
