/** The four numbers, how well they fit, and what changes them at a stroke. */

import { useApp } from "../app_state";
import { FIELDS, MORE_FIELDS } from "../state/steps";
import { CommandButton } from "../ui/command_button";
import { PoseField } from "./pose_field";

export function PosePanel() {
  const { review } = useApp();
  if (!review.draft.value || !review.detail.value) return null;
  const snapping = review.busy.value === "snap";
  return (
    <section class="panel pose" aria-labelledby="pose-head">
      <h2 id="pose-head">Pose</h2>
      <Fit />
      {FIELDS.map((field) => (
        <PoseField key={field.name} field={field} />
      ))}
      <details>
        <summary>More: where the model's origin lies</summary>
        {MORE_FIELDS.map((field) => (
          <PoseField key={field.name} field={field} />
        ))}
      </details>
      <div class="buttons">
        <CommandButton id="snap" icon="snap" label="Snap" disabled={snapping}>
          {snapping && <span class="spinner" aria-hidden="true" />}
        </CommandButton>
        <CommandButton id="snap-full" label="Snap fully" disabled={snapping} />
        <CommandButton id="flip" icon="flip" label="Flip 180°" />
      </div>
      <div class="buttons">
        <CommandButton id="undo" icon="undo" label="Undo" disabled={!review.canUndo.value} />
        <CommandButton id="redo" icon="redo" label="Redo" disabled={!review.canRedo.value} />
        <CommandButton id="reset" icon="reset" label="Reset" disabled={!review.changed.value} />
      </div>
    </section>
  );
}

function Fit() {
  const { review } = useApp();
  const now = review.iou.value;
  const stored = review.detail.value?.mask_iou ?? null;
  const masked = review.draft.value?.region?.mask ?? review.detail.value?.detection.mask;
  if (!masked) {
    return (
      <p class="fit">
        <span>No mask to measure with; draw one with </span>
        <kbd>M</kbd>
      </p>
    );
  }
  return (
    <div class="fit">
      <span>IoU with the mask</span>
      <output class="fit-now" data-iou={now === null ? "" : now.toFixed(4)}>
        {now === null ? "–" : now.toFixed(2)}
      </output>
      <meter min={0} max={1} value={now ?? 0} aria-label="IoU with the mask" />
      {stored !== null && review.changed.value && <small>was {stored.toFixed(2)}</small>}
    </div>
  );
}
