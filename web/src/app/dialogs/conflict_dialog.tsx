/** Somebody was quicker: who, what, and the two ways on. Nothing is stored or lost until one is chosen. */

import { useApp } from "../app_state";
import { applyMine, loadPhotoAgain, loadTheirs } from "../deciding";
import { type Conflict, MEANT } from "../notices";
import { describe, draftOf } from "../state/draft";
import { verdictLabel } from "../state/filters";
import { Dialog } from "../ui/dialog";

export function ConflictDialog({ conflict, onClose }: { conflict: Conflict; onClose(): void }) {
  const { review } = useApp();
  const { theirs, current, request } = conflict;
  const work = review.desk.get(conflict.id);
  const last = theirs?.history.filter((each) => each.kind === "human").at(-1);
  const who = current.by ?? last?.author ?? "Somebody";
  const changed = work && theirs ? describe(work.base, draftOf(theirs)) : [];
  const mine = work ? describe(work.base, work.undo.present) : [];
  if (!current.in_force) return <Replaced conflict={conflict} mine={mine} onClose={onClose} />;
  const why = last ? [last.reason, last.note].filter(Boolean).join(": ") : "";
  return (
    <Dialog title="Decided meanwhile" onClose={onClose}>
      <div class="conflict">
        <p>
          While you had this object open, <b>{who}</b> decided on it
          {last && <> at {new Date(last.at).toLocaleTimeString()}</>}. Yours is not stored yet.
        </p>
        <dl>
          <div>
            <dt>{who}</dt>
            <dd>
              {verdictLabel(current.verdict)}
              {changed.length > 0 && `: ${changed.join(", ")}`}
              {why && ` (${why})`}
            </dd>
          </div>
          <div>
            <dt>You</dt>
            <dd>
              {MEANT[request.verdict]}
              {mine.length > 0 && `: ${mine.join(", ")}`}
              {request.reason && ` (${request.reason})`}
            </dd>
          </div>
        </dl>
        <div class="buttons">
          <button type="button" class="command main" data-first onClick={() => void loadTheirs(review, conflict)}>
            Load theirs
          </button>
          <button type="button" class="command" onClick={() => void applyMine(review, conflict)}>
            Apply mine on top
          </button>
          <button type="button" class="command" onClick={onClose}>
            Decide later
          </button>
        </div>
        <p class="hint">
          Either way both stay in the history. Loading theirs keeps your changes one redo away; applying yours stores
          pose, model and region as you see them here; closing keeps them as a draft.
        </p>
      </div>
    </Dialog>
  );
}

/** The photo was annotated anew meanwhile: this answer can be decided on no more. */
function Replaced({ conflict, mine, onClose }: { conflict: Conflict; mine: string[]; onClose(): void }) {
  const { review } = useApp();
  return (
    <Dialog title="Annotated anew" onClose={onClose}>
      <div class="conflict">
        <p>
          While you had this object open, its photo was annotated anew, and another answer holds in this one's place.
          Yours is not stored{mine.length > 0 && `: ${mine.join(", ")}`}.
        </p>
        <div class="buttons">
          <button
            type="button"
            class="command main"
            data-first
            onClick={() => void loadPhotoAgain(review, conflict)}
          >
            Load the photo again
          </button>
          <button type="button" class="command" onClick={onClose}>
            Stay here
          </button>
        </div>
        <p class="hint">Your changes belong to the former answer and go with it.</p>
      </div>
    </Dialog>
  );
}
