/** Whose decisions these are. */

import { useState } from "preact/hooks";

import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";

export function AuthorDialog({ then, onClose }: { then: (() => void) | null; onClose(): void }) {
  const { review } = useApp();
  const [name, setName] = useState(review.author.value);

  function keep(): void {
    if (name.trim() === "") return;
    review.setAuthor(name);
    onClose();
    then?.();
  }

  return (
    <Dialog title="Your name" onClose={onClose}>
      <div class="form">
        <p>It is stored with every decision of yours, and this browser remembers it.</p>
        <label>
          Name
          <input
            type="text"
            data-first
            maxLength={100}
            autocomplete="name"
            value={name}
            onInput={(event) => setName(event.currentTarget.value)}
            onKeyDown={(event) => {
              if (event.key !== "Enter") return;
              // The focus goes back to a button, which is not meant by this key.
              event.preventDefault();
              keep();
            }}
          />
        </label>
        <button type="button" class="command main" disabled={name.trim() === ""} onClick={keep}>
          {then ? "Keep it and go on" : "Keep it"}
        </button>
      </div>
    </Dialog>
  );
}
