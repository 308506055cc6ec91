/** The photo with the model over it, and the tools for box and mask. */

import { useEffect, useRef, useState } from "preact/hooks";

import { useApp } from "../app_state";
import { ViewHost } from "../view_host";
import { RegionTools } from "./region_tools";

export function Stage() {
  const app = useApp();
  const { review } = app;
  const container = useRef<HTMLDivElement>(null);
  const [host, setHost] = useState<ViewHost | null>(null);

  useEffect(() => {
    if (!container.current) return undefined;
    const made = new ViewHost(container.current, app);
    app.toggleZoom = () => made.toggleZoom();
    setHost(made);
    return () => made.dispose();
  }, []);

  const detail = review.detail.value;
  const drawing = review.drawing.value;
  const trouble = review.trouble.value;
  const unseen = host?.trouble.value ?? "";
  return (
    <div class="stage" data-drawn={review.drawn.value}>
      <div
        ref={container}
        class={host?.loading.value ? "view loading" : "view"}
        tabIndex={0}
        role="application"
        aria-label={
          detail
            ? `Photo ${detail.photo.name} with the model over it: arrow keys turn the model`
            : "The photo will be here"
        }
      />
      {host && drawing && detail && <RegionTools host={host} />}
      {trouble && (
        <p class="stage-note problem" role="alert">
          {trouble}{" "}
          <button
            type="button"
            onClick={() => {
              const id = review.currentId.peek();
              if (id !== null) void review.open(id);
            }}
          >
            Try again
          </button>
        </p>
      )}
      {!trouble && unseen && (
        <p class="stage-note" role="status">
          {unseen}
        </p>
      )}
      {!detail && !trouble && !review.opening.value && <p class="stage-note">Choose an object of the queue.</p>}
    </div>
  );
}
