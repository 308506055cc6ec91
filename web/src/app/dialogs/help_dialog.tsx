/** All keys, by what they are for, and what the mouse does. */

import { BINDINGS, bindingText, chordText, type Group } from "../keys/bindings";
import { Dialog } from "../ui/dialog";

const MOUSE: readonly [string, string][] = [
  ["Drag", "Azimuth and elevation"],
  ["Shift + drag", "In-plane rotation"],
  ["Alt + drag, right drag", "Move the model"],
  ["Wheel, two fingers", "Focal length"],
];

export function HelpDialog({ onClose }: { onClose(): void }) {
  const groups = [...new Set(BINDINGS.map((each) => each.group))];
  return (
    <Dialog title="Keys" wide onClose={onClose}>
      <div class="help">
        {groups.map((group) => (
          <KeyGroup key={group} group={group} />
        ))}
        <section>
          <h3>Mouse on the photo</h3>
          <dl class="keys">
            {MOUSE.map(([how, what]) => (
              <div key={how}>
                <dt>{how}</dt>
                <dd>{what}</dd>
              </div>
            ))}
          </dl>
        </section>
      </div>
      <p class="hint">Arrow keys turn the model while the photo has the focus. Keys rest while you write in a field.</p>
    </Dialog>
  );
}

function KeyGroup({ group }: { group: Group }) {
  return (
    <section>
      <h3>{group}</h3>
      <dl class="keys">
        {BINDINGS.filter((each) => each.group === group).map((binding) => (
          <div key={bindingText(binding)}>
            <dt>
              {(binding.shown ? [binding.shown] : binding.chords.map(chordText)).map((text) => (
                <kbd key={text}>{text}</kbd>
              ))}
            </dt>
            <dd>{binding.what}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}
