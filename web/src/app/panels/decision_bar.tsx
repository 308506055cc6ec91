/** What is said of the object on the screen. */

import { useApp } from "../app_state";
import { CommandButton } from "../ui/command_button";

export function DecisionBar() {
  const { review } = useApp();
  const changed = review.changed.value;
  const saving = review.busy.value === "save";
  const off = !review.ready.value || saving;
  return (
    <div class="decision-bar" role="toolbar" aria-label="Decision">
      <CommandButton id="previous" icon="previous" label="Previous" bare />
      <CommandButton id="next" icon="next" label="Next" bare />
      <span class="spring" />
      <CommandButton
        id="accept"
        icon="accept"
        label={changed ? "Store changes" : "Accept"}
        tone="good"
        disabled={off}
      >
        <kbd aria-hidden="true">A</kbd>
      </CommandButton>
      <CommandButton id="reject" icon="reject" label="Reject" tone="bad" disabled={off}>
        <kbd aria-hidden="true">X</kbd>
      </CommandButton>
      <CommandButton id="skip" icon="skip" label="Skip" disabled={off}>
        <kbd aria-hidden="true">N</kbd>
      </CommandButton>
      <CommandButton id="later" icon="later" label="Later" disabled={off}>
        <kbd aria-hidden="true">L</kbd>
      </CommandButton>
      <span class="spring" />
    </div>
  );
}
