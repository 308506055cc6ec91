/** The bar at the top: how far the store is, and the page's own doings. */

import { useApp } from "../app_state";
import { CommandButton } from "../ui/command_button";
import { Icon } from "../ui/icon";

const THEMES = { auto: "as the system", light: "light", dark: "dark" } as const;

export function Header() {
  const app = useApp();
  const { review } = app;
  const session = review.session.value;
  const theme = app.theme.value;
  return (
    <header class="page-head">
      <h1>
        <Icon name="cube" />
        cadpose <span class="light-word">review</span>
      </h1>
      <span class="store" title={session?.store}>
        {session?.store.split("/").at(-1) ?? ""}
      </span>
      <Progress />
      <span class="spring" />
      <CommandButton id="upload" icon="upload" label="Add photos" />
      <CommandButton id="stats" icon="stats" label="Statistics" />
      <CommandButton id="export" icon="download" label="Export" />
      <button
        type="button"
        class="command author"
        title="Your name, which is stored with what you decide"
        onClick={() => {
          review.dialog.value = { kind: "author", then: null };
        }}
      >
        <Icon name="person" />
        <span>{review.author.value || "Your name"}</span>
      </button>
      <CommandButton id="theme" icon={theme} label={`Colours: ${THEMES[theme]}`} bare />
      <CommandButton id="help" icon="help" label="Keys and help" bare />
    </header>
  );
}

function Progress() {
  const progress = useApp().review.progress.value;
  if (!progress || progress.total === 0) return null;
  const { total, decided } = progress;
  return (
    <span class="progress" title="Objects on which a person has decided">
      <progress max={total} value={decided} aria-label="Decided" />
      <span>
        {decided.toLocaleString("en")} of {total.toLocaleString("en")}
        <small> ({Math.floor((decided / total) * 100)} %)</small>
      </span>
    </span>
  );
}
