/** What each key and button does. */

import type { App } from "./app_state";
import { accept, decide } from "./deciding";
import type { ActionId } from "./keys/bindings";
import { snap } from "./refining";
import { type FieldName, valueOf, withValue } from "./state/steps";

const NEEDS_ITEM: ReadonlySet<ActionId> = new Set<ActionId>([
  "accept",
  "reject",
  "skip",
  "later",
  "search",
  "replace",
  "box",
  "mask",
]);

export function command(app: App, id: ActionId, digit: number): void {
  const { review, display, models } = app;
  if (NEEDS_ITEM.has(id) && !review.ready.peek()) return;
  switch (id) {
    case "next":
      return void review.move(1);
    case "previous":
      return void review.move(-1);
    case "queue":
      review.tab.value = "queue";
      return app.focusQueue();
    case "accept":
      return void accept(review);
    case "reject":
      review.dialog.value = { kind: "reject" };
      return;
    case "skip":
      return void decide(review, "skip");
    case "later":
      return void decide(review, "review");
    case "azimuth+":
      return step(app, "azimuth", 1);
    case "azimuth-":
      return step(app, "azimuth", -1);
    case "azimuth++":
      return step(app, "azimuth", 10);
    case "azimuth--":
      return step(app, "azimuth", -10);
    case "elevation+":
      return step(app, "elevation", 1);
    case "elevation-":
      return step(app, "elevation", -1);
    case "elevation++":
      return step(app, "elevation", 10);
    case "elevation--":
      return step(app, "elevation", -10);
    case "inplane+":
      return step(app, "inplane", 1);
    case "inplane-":
      return step(app, "inplane", -1);
    case "focal+":
      return zoom(app, 1.01);
    case "focal-":
      return zoom(app, 1 / 1.01);
    case "flip":
      return models.flip();
    case "twin":
      return models.cycleTwin();
    case "candidate":
      return models.candidate(digit - 1);
    case "hypothesis":
      return models.hypothesis(digit - 1);
    case "search":
      review.dialog.value = { kind: "search" };
      return;
    case "snap":
      return void snap(review, "fast");
    case "snap-full":
      return void snap(review, "full");
    case "undo":
      return review.undo();
    case "redo":
      return review.redo();
    case "reset":
      return review.reset();
    case "display":
      return display.cycle(1);
    case "display-back":
      return display.cycle(-1);
    case "opacity+":
      return display.setOpacity(display.opacity.peek() + 0.1);
    case "opacity-":
      return display.setOpacity(display.opacity.peek() - 0.1);
    case "wipe":
      return display.toggleWipe();
    case "photo":
      return display.togglePhoto();
    case "zoom":
      return app.toggleZoom();
    case "box":
    case "mask":
      review.drawing.value = review.drawing.peek() === id ? "" : id;
      return;
    case "help":
    case "upload":
    case "stats":
    case "export":
    case "replace":
      review.dialog.value = { kind: id };
      return;
    case "theme":
      return app.cycleTheme();
  }
}

export function step(app: App, field: FieldName, by: number): void {
  const pose = app.review.draft.peek()?.pose;
  const stepped = pose && withValue(pose, field, valueOf(pose, field) + by);
  if (stepped) app.review.setPose(stepped, `step-${field}`);
}

function zoom(app: App, by: number): void {
  const pose = app.review.draft.peek()?.pose;
  const stepped = pose && withValue(pose, "focal_px", pose.focal_px * by);
  if (stepped) app.review.setPose(stepped, "step-focal_px");
}
