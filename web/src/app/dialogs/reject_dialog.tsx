/** Why an annotation is rejected: a reason by its digit, or in one's own words. */

import { useState } from "preact/hooks";

import { useApp } from "../app_state";
import { decide } from "../deciding";
import { isWriting } from "../keys/match";
import { Dialog } from "../ui/dialog";

export function RejectDialog({ onClose }: { onClose(): void }) {
  const { review } = useApp();
  const reasons = review.session.value?.reasons ?? [];
  const [note, setNote] = useState("");

  function reject(reason: string): void {
    onClose();
    void decide(review, "reject", { reason, note: note.trim() });
  }

  return (
    <Dialog title="Reject: why?" onClose={onClose}>
      <div
        class="reasons"
        onKeyDown={(event) => {
          if (event.repeat || isWriting(event.target) || event.ctrlKey || event.altKey || event.metaKey) return;
          const reason = reasons[Number(event.key) - 1];
          if (reason) {
            event.preventDefault();
            reject(reason);
          }
        }}
      >
        {reasons.map((reason, place) => (
          <button key={reason} type="button" data-first={place === 0 ? "" : undefined} onClick={() => reject(reason)}>
            <kbd>{place + 1}</kbd> {reason}
          </button>
        ))}
        <label>
          In your own words
          <textarea rows={2} value={note} onInput={(event) => setNote(event.currentTarget.value)} />
        </label>
        <button type="button" class="command bad" disabled={note.trim() === ""} onClick={() => reject("")}>
          Reject with these words
        </button>
      </div>
    </Dialog>
  );
}
