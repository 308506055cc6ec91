/** Decisions: sent at once, never over somebody's head, never lost. */

import { ApiError, sentence } from "./api/client";
import type { Decision, DecisionRequest, Detail } from "./api/types";
import { type Conflict, DONE } from "./notices";
import type { Review } from "./review";
import { type Changes, changesOf, changesOnTop } from "./state/draft";

export interface Why {
  reason?: string;
  note?: string;
}

/** Accepts what is on the screen, with the changes if there are any. */
export function accept(review: Review): Promise<void> {
  review.settle();
  return decide(review, review.changed.peek() ? "edit" : "accept");
}

/** Sends a decision on the open item and goes on to the next; asks for a name first where there is none. */
export async function decide(review: Review, verdict: Decision, why: Why = {}): Promise<void> {
  review.settle();
  const detail = review.detail.peek();
  const work = review.work;
  if (!detail || !work || review.busy.peek() === "save") return;
  if (!review.author.peek()) {
    review.dialog.value = { kind: "author", then: () => void decide(review, verdict, why) };
    return;
  }
  const said = { reason: "", note: "", ...why, verdict, version: work.version, author: review.author.peek() };
  const changes = verdict === "edit" ? changesOf(work.base, work.undo.present) : NONE;
  await send(review, detail.id, named(review.unanswered.get(detail.id), { ...said, ...changes }));
}

const NONE: Changes = { pose: null, cad_id: null, region: null };

/** Bears the name of the request before if it says the same: the server may have stored that one already. */
function named(before: DecisionRequest | undefined, request: Omit<DecisionRequest, "request_id">): DecisionRequest {
  const again = before && { ...request, request_id: before.request_id };
  return again && same(again, before) ? again : { ...request, request_id: requestId() };
}

function same(a: DecisionRequest, b: DecisionRequest): boolean {
  const sorted = (request: DecisionRequest): string => JSON.stringify(Object.entries(request).sort());
  return sorted(a) === sorted(b);
}

/** 32 hex digits. Not by randomUUID, which only exists where the connection counts as safe. */
function requestId(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

export async function send(review: Review, id: string, request: DecisionRequest): Promise<void> {
  review.busy.value = "save";
  try {
    const { item, version } = await review.api.decide(id, request);
    review.unanswered.delete(id);
    // A skip says nothing of the object, nor do the changes of somebody who wants another look: they stay.
    if (request.verdict === "accept" || request.verdict === "edit" || request.verdict === "reject") {
      review.desk.drop(id);
    } else {
      review.desk.restamp(id, version);
    }
    review.details.forget(id);
    review.took(item);
    review.say(`${DONE[request.verdict]}: ${item.category} in ${item.photo.name.split("/").at(-1)}.`, "good", [
      { label: "Go back to it", run: () => void review.open(id) },
    ]);
    review.deskTick.value++;
    review.busy.value = "";
    if (review.currentId.peek() !== id) return;
    await review.moveOn();
  } catch (error) {
    review.busy.value = "";
    if (error instanceof ApiError && error.kind === "conflict" && error.current) {
      review.unanswered.delete(id);
      const theirs = await review.details.fresh(id).catch(() => null);
      const conflict: Conflict = { id, request, current: error.current, theirs };
      review.dialog.value = { kind: "conflict", conflict };
      return;
    }
    review.unanswered.set(id, request);
    review.say(`Not stored. ${sentence(error)}`, "bad", [
      { label: "Try again", run: () => void send(review, id, request) },
    ]);
  }
}

/** Shows what the other person stored; one redo brings back one's own changes. */
export async function loadTheirs(review: Review, conflict: Conflict): Promise<void> {
  review.dialog.value = null;
  try {
    const theirs = conflict.theirs ?? (await review.details.fresh(conflict.id));
    const work = review.desk.rebase(theirs);
    if (review.currentId.peek() === conflict.id) review.show(theirs, work);
    const item = review.queue.item(conflict.id);
    if (item) review.queue.update(updated(item, theirs));
    const mine = work.undo.canRedo ? " Redo brings your changes back." : "";
    review.say(`This is what is stored now.${mine}`);
  } catch (error) {
    review.say(sentence(error), "bad", [{ label: "Try again", run: () => void loadTheirs(review, conflict) }]);
  }
}

/** Stores one's own decision after the other person's, so that the object stands as it does on this page. */
export async function applyMine(review: Review, conflict: Conflict): Promise<void> {
  review.dialog.value = null;
  const { id, request } = conflict;
  try {
    const theirs = conflict.theirs ?? (await review.details.fresh(id));
    const own = { ...request, version: theirs.version };
    await send(review, id, named(undefined, { ...own, ...onTop(review, id, request, theirs) }));
  } catch (error) {
    review.say(sentence(error), "bad", [{ label: "Try again", run: () => void applyMine(review, conflict) }]);
  }
}

/** What was sent first only tells the difference to what one had seen, which does not hold any more. */
function onTop(
  review: Review,
  id: string,
  request: DecisionRequest,
  theirs: Detail,
): Changes & { verdict: Decision } {
  const work = review.desk.get(id);
  const { verdict } = request;
  if (!work || (verdict !== "accept" && verdict !== "edit")) return { verdict, ...NONE };
  const changes = changesOnTop(theirs, work.undo.present, work.detected);
  const differs = changes.pose !== null || changes.cad_id !== null || changes.region !== null;
  return { verdict: differs ? "edit" : "accept", ...changes };
}

/** After the photo was annotated anew: to the answers that hold for it now. */
export async function loadPhotoAgain(review: Review, conflict: Conflict): Promise<void> {
  review.dialog.value = null;
  try {
    const old = conflict.theirs ?? (await review.details.fresh(conflict.id));
    await review.queue.reload();
    review.desk.drop(conflict.id);
    review.details.forget(conflict.id);
    review.deskTick.value++;
    const now = old.siblings.find((id) => id !== conflict.id);
    if (now === undefined) return await review.moveOn("Nothing was found in that photo this time.");
    await review.open(now);
    review.say("This is what holds for the photo now.");
  } catch (error) {
    review.say(sentence(error), "bad", [{ label: "Try again", run: () => void loadPhotoAgain(review, conflict) }]);
  }
}

function updated<T extends { version: number }>(item: T, theirs: Detail): T {
  const { version, verdict, decided_by, edited, cad, box_iou, mask_iou } = theirs;
  const known = { version, verdict, decided_by, edited, box_iou, mask_iou };
  return { ...item, ...known, cad: { id: cad.id, name: cad.name } };
}
