/** The store as a file of some format. */

import { useState } from "preact/hooks";

import { exportUrl, sentence } from "../api/client";
import { useApp } from "../app_state";
import { toggled, VERDICTS } from "../state/filters";
import { Dialog } from "../ui/dialog";
import { Icon } from "../ui/icon";
import { download } from "../ui/save";

export function ExportDialog({ onClose }: { onClose(): void }) {
  const { api, review } = useApp();
  const formats = review.session.value?.formats ?? [];
  const [format, setFormat] = useState(formats.find((each) => !each.needs)?.name ?? "");
  const [verdicts, setVerdicts] = useState<string[]>(["accept", "edit"]);
  const [state, setState] = useState<"" | "working" | "done">("");
  const [trouble, setTrouble] = useState("");

  async function run(): Promise<void> {
    setState("working");
    setTrouble("");
    try {
      // What can be told before is: the file itself goes past the page, straight to the browser's downloads.
      const session = await api.session();
      const needs = session.formats.find((each) => each.name === format)?.needs;
      if (needs) throw new Error(needs);
      const { total } = await api.queue({ verdict: verdicts, limit: 1 });
      if (total === 0) throw new Error("There is no object of that choice to export.");
      download(exportUrl(format, verdicts));
      setState("done");
      review.say("The export is being written; it comes to your browser's downloads.", "good");
    } catch (error) {
      setState("");
      setTrouble(sentence(error));
    }
  }

  return (
    <Dialog title="Export" onClose={onClose}>
      <div class="form">
        <fieldset>
          <legend>Format</legend>
          {formats.map(({ name, title, needs }, place) => (
            <label key={name} class="choice">
              <input
                type="radio"
                name="format"
                value={name}
                data-first={place === 0 ? "" : undefined}
                checked={format === name}
                disabled={needs !== ""}
                onChange={() => setFormat(name)}
              />
              <span>
                {title}
                {needs && <small>{needs}</small>}
              </span>
            </label>
          ))}
        </fieldset>
        <fieldset class="chips">
          <legend>Only objects that stand as (all when none is chosen)</legend>
          {VERDICTS.map(({ value, label }) => (
            <label key={value} class="chip">
              <input
                type="checkbox"
                checked={verdicts.includes(value)}
                onChange={() => setVerdicts(toggled(verdicts, value))}
              />
              <span>{label}</span>
            </label>
          ))}
        </fieldset>
        {trouble && (
          <p class="problem" role="alert">
            {trouble}
          </p>
        )}
        <button
          type="button"
          class="command main"
          disabled={!format || state === "working"}
          onClick={() => void run()}
        >
          <Icon name="download" />
          <span>{state === "working" ? "Looking …" : state === "done" ? "Download again" : "Download"}</span>
        </button>
      </div>
    </Dialog>
  );
}
