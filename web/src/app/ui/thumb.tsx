/** A thumbnail that leaves its place empty, with a word in it, where there is no picture. */

import { useState } from "preact/hooks";

interface Props {
  url: string | null;
  size: number;
  /** Shown where the picture is missing. */
  instead?: string;
  lazy?: boolean;
}

export function Thumb({ url, size, instead = "", lazy = false }: Props) {
  const [missing, setMissing] = useState("");
  if (!url || missing === url) {
    return (
      <span class="thumb none" style={{ width: `${size}px`, height: `${size}px` }} aria-hidden="true">
        {instead.slice(0, 3)}
      </span>
    );
  }
  return (
    <img
      class="thumb"
      src={url}
      width={size}
      height={size}
      alt=""
      decoding="async"
      loading={lazy ? "lazy" : "eager"}
      draggable={false}
      onError={() => setMissing(url)}
    />
  );
}
