/** The open item stands in the page's address, so that a reload or a link finds it. */

import { effect } from "@preact/signals";

import type { App } from "./app_state";

const ITEM = /^#\/([0-9A-Za-z_-]{8,})$/;

export function itemOf(hash: string): string | null {
  return ITEM.exec(hash)?.[1] ?? null;
}

export function keepAddress(app: App): void {
  effect(() => {
    const id = app.review.currentId.value;
    if (id !== null && itemOf(location.hash) !== id) history.replaceState(null, "", `#/${id}`);
  });
  window.addEventListener("hashchange", () => {
    const id = itemOf(location.hash);
    if (id !== null && id !== app.review.currentId.peek()) void app.review.open(id);
  });
}

/** The browser asks before the page goes with changes that are not stored, or photos that are not sent. */
export function guardLeaving(app: App): void {
  window.addEventListener("beforeunload", (event) => {
    const sending = app.uploads.peek().some((each) => each.state === "waiting" || each.state === "sending");
    if (app.review.desk.dirty().length > 0 || sending) event.preventDefault();
  });
}
