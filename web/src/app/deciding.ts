/** Decisions: sent at once, never over somebody's head, never lost. */

import { ApiError, sentence } from "./api/client";
import type { Decision, DecisionRequest, Detail } from "./api/types";
import { type Conflict, DONE } from "./notices";
import type { Review } from "./review";
import { changesOf, type Draft } from "./state/draft";

export interface Why {
  reason?: string;
  note?: string;
}

/** Accepts what is on the screen, with the changes if there are any. */
export function accept(review: Review): Promise<void> {
  return decide(review, review.changed.peek() ? "edit" : "accept");
}

/** Sends a decision on the open item and goes on to the next; asks for a name first where there is none. */
export async function decide(review: Review, verdict: Decision, why: Why = {}): Promise<void> {
  const detail = review.detail.peek();
  const base = review.base.peek();
  const draft = review.draft.peek();
  if (!detail || !base || !draft || review.busy.peek() === "save") return;
  if (!review.author.peek()) {
    review.dialog.value = { kind: "author", then: () => void decide(review, verdict, why) };
    return;
  }
  await send(review, detail.id, requestOf(review, detail, base, draft, verdict, why));
}

function requestOf(
  review: Review,
  detail: Detail,
  base: Draft,
  draft: Draft,
  verdict: Decision,
  why: Why,
): DecisionRequest {
  const version = review.desk.get(detail.id)?.version ?? detail.version;
  const author = review.author.peek();
  const said = { verdict, version, author, reason: why.reason ?? "", note: why.note ?? "" };
  const changes = verdict === "edit" ? changesOf(base, draft) : { pose: null, cad_id: null, region: null };
  return { ...said, ...changes };
}

export async function send(review: Review, id: string, request: DecisionRequest): Promise<void> {
  review.busy.value = "save";
  try {
    const { item, version } = await review.api.decide(id, request);
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
      const theirs = await review.details.fresh(id).catch(() => null);
      const conflict: Conflict = { id, request, current: error.current, theirs };
      review.dialog.value = { kind: "conflict", conflict };
      return;
    }
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

/** Stores one's own decision after the other person's. */
export async function applyMine(review: Review, conflict: Conflict): Promise<void> {
  review.dialog.value = null;
  await send(review, conflict.id, { ...conflict.request, version: conflict.current.version });
}

function updated<T extends { version: number }>(item: T, theirs: Detail): T {
  const { version, verdict, decided_by, edited, cad, box_iou, mask_iou } = theirs;
  const known = { version, verdict, decided_by, edited, box_iou, mask_iou };
  return { ...item, ...known, cad: { id: cad.id, name: cad.name } };
}
