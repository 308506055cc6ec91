/** Listens to the keyboard for the whole page. */

import type { App } from "./app_state";
import { command } from "./commands";
import { REPEATING } from "./keys/bindings";
import { isTaken, isWriting, match } from "./keys/match";

export function listen(app: App, target: Window): () => void {
  function onKeyDown(event: KeyboardEvent): void {
    const where = event.target instanceof Element ? event.target : null;
    // A button with the focus would be pressed again and again.
    if (event.repeat && event.key === "Enter" && where instanceof HTMLButtonElement) event.preventDefault();
    if (event.defaultPrevented || event.isComposing || app.review.dialog.peek()) return;
    if (event.key === "Escape") return escape(app, where);
    if (isWriting(event.target) || isTaken(event, event.target)) return;
    // The page as a whole counts as the photo, and arrows turn the model where a button has the focus, too.
    const inView =
      where === null ||
      where === document.body ||
      where.closest(".view") !== null ||
      (event.key.startsWith("Arrow") && where instanceof HTMLButtonElement);
    const pressed = match(event, inView);
    if (!pressed) return;
    event.preventDefault();
    if (event.repeat && !REPEATING.has(pressed.id)) return;
    command(app, pressed.id, pressed.digit);
  }
  target.addEventListener("keydown", onKeyDown);
  return () => target.removeEventListener("keydown", onKeyDown);
}

/** Out of a field, out of drawing, back to the photo. */
function escape(app: App, where: Element | null): void {
  app.review.drawing.value = "";
  if (where instanceof HTMLElement && where !== document.body) app.review.focusView();
}
