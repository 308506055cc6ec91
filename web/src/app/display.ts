/** How the model is shown over the photo. */

import { signal } from "@preact/signals";

import type { Settings } from "./state/settings";

export type DisplayMode = "blend" | "outline" | "wireframe" | "mask" | "difference" | "photo";

export const MODES: readonly { value: DisplayMode; label: string; what: string }[] = [
  { value: "blend", label: "Blend", what: "The model over the photo" },
  { value: "outline", label: "Outline", what: "The edge of the model's silhouette" },
  { value: "wireframe", label: "Wire", what: "The model's edges" },
  { value: "mask", label: "Mask", what: "Silhouette and mask: white where both are, orange the model alone, blue the mask alone" },
  { value: "difference", label: "Difference", what: "How the colours of model and photo differ" },
  { value: "photo", label: "Photo", what: "The photo alone" },
];

export class Display {
  readonly mode = signal<DisplayMode>("blend");
  readonly opacity = signal(0.6);
  /** Where the wipe stands, in shares of the width; null while it is off. */
  readonly wipe = signal<number | null>(null);
  private last: DisplayMode = "blend";

  constructor(private readonly settings: Settings) {
    this.mode.value = MODES.find((each) => each.value === settings.display)?.value ?? "blend";
    this.opacity.value = settings.opacity;
  }

  choose(mode: DisplayMode): void {
    if (this.mode.peek() !== "photo") this.last = this.mode.peek();
    this.mode.value = mode;
    if (mode !== "photo") this.settings.display = mode;
  }

  cycle(by: 1 | -1): void {
    const place = MODES.findIndex((each) => each.value === this.mode.peek());
    const next = MODES[(place + by + MODES.length) % MODES.length];
    if (next) this.choose(next.value);
  }

  togglePhoto(): void {
    this.choose(this.mode.peek() === "photo" ? this.last : "photo");
  }

  setOpacity(opacity: number): void {
    const kept = Math.min(1, Math.max(0, Math.round(opacity * 100) / 100));
    this.opacity.value = kept;
    this.settings.opacity = kept;
  }

  toggleWipe(): void {
    this.wipe.value = this.wipe.peek() === null ? 0.5 : null;
  }
}
