/** Two pictures of the same size over each other, and a wipe between them. */

import { useState } from "preact/hooks";

interface Props {
  before: string;
  after: string;
  width: number;
  height: number;
}

export function Compare({ before, after, width, height }: Props) {
  const [place, setPlace] = useState(50);
  return (
    <figure class="compare">
      <div class="compare-frame" style={{ aspectRatio: `${width} / ${height}`, width: `min(100%, ${(56 * width) / height}vh)` }}>
        <img src={after} alt="With the other model" />
        <img src={before} alt="The photo as it was" style={{ clipPath: `inset(0 ${100 - place}% 0 0)` }} />
        <span class="compare-line" style={{ left: `${place}%` }} aria-hidden="true" />
      </div>
      <label>
        <span>Before</span>
        <input
          type="range"
          min={0}
          max={100}
          value={place}
          aria-label="Wipe between before and after"
          onInput={(event) => setPlace(event.currentTarget.valueAsNumber)}
        />
        <span>After</span>
      </label>
    </figure>
  );
}
