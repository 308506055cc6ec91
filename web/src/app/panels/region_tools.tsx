/** Box and mask drawn by hand over the photo. */

import { useEffect, useRef, useState } from "preact/hooks";
import { effect } from "@preact/signals";

import { RegionEditor } from "../../view/region_editor";
import { encodeRle } from "../../view/rle";
import type { Region } from "../api/types";
import { useApp } from "../app_state";
import type { ViewHost } from "../view_host";

type Tool = "box" | "polygon" | "brush" | "erase";

const TOOLS: readonly { value: Tool; label: string }[] = [
  { value: "box", label: "Box" },
  { value: "polygon", label: "Polygon" },
  { value: "brush", label: "Brush" },
  { value: "erase", label: "Eraser" },
];

export function RegionTools({ host }: { host: ViewHost }) {
  const { review } = useApp();
  const editor = useRef<RegionEditor | null>(null);
  const drawing = review.drawing.value;
  const [tool, setTool] = useState<Tool>(drawing === "mask" ? "polygon" : "box");
  const [size, setSize] = useState(20);

  useEffect(() => {
    const detail = review.detail.peek();
    if (!detail) return undefined;
    let own: Region | null = null;
    const made = new RegionEditor(host.container, {
      onChange: (box, mask) => {
        if (review.detail.peek()?.id !== detail.id) return;
        const { width, height } = detail.photo;
        const kept = box ?? review.draft.peek()?.region?.box ?? detail.detection.box;
        own = { box: kept, mask: mask ? encodeRle(mask, width, height) : null };
        review.setRegion(own);
      },
    });
    editor.current = made;
    setSize(made.brushSize);
    const end = effect(() => {
      // What undo and redo bring back goes into the editor; what it said itself is in there.
      const region = review.draft.value?.region ?? null;
      if (region !== null && region === own) return;
      const box = region?.box ?? detail.detection.box;
      made.setRegion(box, host.maskOf(region ? region.mask : detail.detection.mask));
    });
    return () => {
      end();
      made.dispose();
      editor.current = null;
    };
  }, [review.detail.value?.id]);

  useEffect(() => setTool(drawing === "mask" ? "polygon" : "box"), [drawing]);
  useEffect(() => {
    editor.current?.setTool(tool);
    if (editor.current) editor.current.brushSize = size;
  }, [tool, size]);

  function end(): void {
    review.drawing.value = "";
    review.focusView();
  }

  return (
    <div class="region-tools" role="toolbar" aria-label="Box and mask">
      <div class="segments" role="group" aria-label="Tool">
        {TOOLS.map(({ value, label }) => (
          <button key={value} type="button" aria-pressed={tool === value} onClick={() => setTool(value)}>
            {label}
          </button>
        ))}
      </div>
      {(tool === "brush" || tool === "erase") && (
        <label>
          Size
          <input
            type="range"
            min={2}
            max={200}
            value={size}
            onInput={(event) => setSize(event.currentTarget.valueAsNumber)}
          />
        </label>
      )}
      {tool === "polygon" && (
        <>
          <button type="button" class="command" onClick={() => editor.current?.newRing()}>
            New part
          </button>
          <button type="button" class="command" onClick={() => editor.current?.deleteSelected()}>
            Delete point
          </button>
        </>
      )}
      <span class="spring" />
      <button type="button" class="command main" onClick={end}>
        Done
      </button>
    </div>
  );
}
