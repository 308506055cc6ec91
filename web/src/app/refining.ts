/** Snap: the server refines from where the person left the model. */

import { isAbort, sentence } from "./api/client";
import type { Review } from "./review";
import { describe, type Draft } from "./state/draft";

export async function snap(review: Review, mode: "fast" | "full"): Promise<void> {
  review.settle();
  if (!review.ready.peek()) return;
  const id = review.currentId.peek();
  const before = review.draft.peek();
  if (id === null || !before || review.busy.peek()) return;
  const session = review.session.peek();
  if (session && !session.actions.snap) {
    review.say("Refinement is not available here: start with the library, `cadpose review --library DIR`.", "bad");
    return;
  }
  const controller = new AbortController();
  review.snapping = controller;
  review.busy.value = "snap";
  const iou = review.iou.peek();
  try {
    const found = await review.api.snap(id, before.cad.id, before.pose, mode, before.region, controller.signal);
    if (review.currentId.peek() !== id || !review.ready.peek()) return;
    if (review.draft.peek() !== before) {
      review.say("The model was moved meanwhile; the refinement is left aside.");
      return;
    }
    review.setPose(found.pose);
    review.before.value = before.pose;
    const after = review.draft.peek() ?? before;
    review.say(told(before, after, iou, found.mask_iou, found.seconds), "good", [
      { label: "Undo", run: () => review.undo() },
    ]);
  } catch (error) {
    if (isAbort(error)) return;
    review.say(`No refinement. ${sentence(error)}`, "bad", [
      { label: "Try again", run: () => void snap(review, mode) },
    ]);
  } finally {
    if (review.snapping === controller) {
      review.snapping = null;
      if (review.busy.peek() === "snap") review.busy.value = "";
    }
  }
}

function told(before: Draft, after: Draft, was: number | null, is: number | null, seconds: number): string {
  const changes = describe(before, after);
  const what = changes.length > 0 ? changes.join(", ") : "nothing better nearby";
  const fit = is !== null ? ` Mask IoU ${was !== null ? `${was.toFixed(2)} → ` : ""}${is.toFixed(2)}.` : "";
  return `Snapped in ${seconds.toFixed(1)} s: ${what}.${fit}`;
}
