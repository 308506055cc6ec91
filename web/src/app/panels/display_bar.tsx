/** How the model is shown over the photo, and what is drawn by hand. */

import { useApp } from "../app_state";
import { MODES } from "../display";
import { keyOf } from "../keys/bindings";
import { CommandButton } from "../ui/command_button";

export function DisplayBar() {
  const { review, display } = useApp();
  const mode = display.mode.value;
  const drawing = review.drawing.value;
  const wipe = display.wipe.value;
  return (
    <div class="display-bar" role="toolbar" aria-label="Display">
      <div class="segments" role="group" aria-label="Show the model as">
        {MODES.map(({ value, label, what }) => (
          <button
            key={value}
            type="button"
            aria-pressed={mode === value}
            title={`${what} (${keyOf("display")} for the next)`}
            onClick={() => display.choose(value)}
          >
            {label}
          </button>
        ))}
      </div>
      <label class="opacity" title={`Opacity (${keyOf("opacity-")} ${keyOf("opacity+")})`}>
        <input
          type="range"
          aria-label="Opacity"
          min={0}
          max={1}
          step={0.05}
          value={display.opacity.value}
          onInput={(event) => display.setOpacity(event.currentTarget.valueAsNumber)}
        />
      </label>
      <CommandButton id="wipe" icon="wipe" label="Wipe" pressed={wipe !== null} />
      <CommandButton id="zoom" icon="search" label="Zoom to the object" bare />
      <span class="spring" />
      <CommandButton id="box" icon="box" label="Box" pressed={drawing === "box"} />
      <CommandButton id="mask" icon="mask" label="Mask" pressed={drawing === "mask"} />
    </div>
  );
}
