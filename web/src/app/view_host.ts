/** Ties the drawing of photo and model to the page's state: signals go in, poses come out. */

import { computed, effect, signal } from "@preact/signals";

import { PhotoView } from "../view/photo_view";
import { decodeRle } from "../view/rle";
import { sentence } from "./api/client";
import { meshUrl } from "./api/thumbs";
import type { Cad, Detail, Rle } from "./api/types";
import type { App } from "./app_state";

/** A measurement of the IoU that is quicker than this may go with every frame. */
const QUICK_MS = 8;
const REST_MS = 120;

export class ViewHost {
  readonly view: PhotoView;
  /** Why photo or model cannot be shown. */
  readonly trouble = signal("");
  readonly loading = signal(false);
  /** The item whose photo and model are in the view. */
  private readonly active = signal("");
  private readonly ends: (() => void)[] = [];
  private model = "";
  private turn = 0;
  private frame = 0;
  private timer = 0;
  /** Milliseconds that the last measurement of the IoU took. */
  private cost = Number.POSITIVE_INFINITY;
  private decoded: { rle: Rle; mask: Uint8Array | null } | null = null;

  constructor(
    readonly container: HTMLElement,
    private readonly app: App,
  ) {
    const { review, display } = app;
    this.view = new PhotoView(container, {
      onPose: (pose, done) => {
        if (this.active.peek() !== review.detail.peek()?.id) return;
        if (done) review.setPose(pose);
        else review.preview(pose);
      },
      paused: () => !review.ready.peek(),
      onWipe: (wipe) => {
        display.wipe.value = wipe;
      },
    });
    review.warm = (detail) => {
      this.view.preload(detail.photo.image, urlOf(detail.cad)).catch(() => undefined);
    };
    review.endGesture = () => this.view.finish();
    review.focusView = () => container.focus({ preventScroll: true });

    const cad = computed(() => review.draft.value?.cad ?? null);
    const masked = computed(() => {
      const region = review.draft.value?.region;
      return region ? region.mask : (review.detail.value?.detection.mask ?? null);
    });
    const isActive = (): boolean => this.active.value !== "" && this.active.value === review.detail.value?.id;
    this.ends.push(
      effect(() => {
        const detail = review.detail.value;
        if (detail) void this.load(detail);
        else void this.clear();
      }),
      effect(() => {
        if (isActive() && cad.value) void this.change(cad.value);
      }),
      effect(() => {
        const draft = review.draft.value;
        if (!isActive() || !draft) return;
        this.view.setPose(draft.pose);
        this.measure();
      }),
      effect(() => {
        if (isActive()) this.view.setBefore(review.before.value);
      }),
      effect(() => {
        if (!isActive()) return;
        this.view.setMask(this.maskOf(masked.value));
        this.measure();
      }),
      effect(() => {
        this.view.setDisplay(display.mode.value, display.opacity.value, display.wipe.value);
      }),
    );
  }

  maskOf(rle: Rle | null): Uint8Array | null {
    if (!rle) return null;
    if (this.decoded?.rle !== rle) {
      try {
        this.decoded = { rle, mask: decodeRle(rle) };
      } catch (error) {
        this.app.review.say(`The mask cannot be shown: ${sentence(error)}`, "bad");
        this.decoded = { rle, mask: null };
      }
    }
    return this.decoded.mask;
  }

  /** The object large in the window, or the whole photo where it is that already. */
  toggleZoom(): void {
    const { review } = this.app;
    const box = review.draft.peek()?.region?.box ?? review.detail.peek()?.detection.box ?? null;
    this.view.focusOn(this.view.zoom > 1.05 ? null : box);
  }

  dispose(): void {
    for (const end of this.ends) end();
    cancelAnimationFrame(this.frame);
    clearTimeout(this.timer);
    this.turn++;
    const { review } = this.app;
    review.endGesture = () => undefined;
    review.drawn.value = "";
    this.view.dispose();
  }

  private async load(detail: Detail): Promise<void> {
    const { review } = this.app;
    const turn = ++this.turn;
    if (this.active.peek() === detail.id && review.drawn.peek() === detail.id) {
      this.loading.value = false;
      return;
    }
    const cad = review.draft.peek()?.cad ?? detail.cad;
    this.loading.value = true;
    // Both first, so that the former item stays whole until the new one can take its place.
    await this.view.preload(detail.photo.image, urlOf(cad)).catch(() => undefined);
    if (turn !== this.turn) return;
    this.model = cad.key;
    // A new photo has no mask: whatever follows the item has to be told anew, also where it is the same one.
    this.active.value = "";
    const { image, width, height } = detail.photo;
    const shown = Promise.allSettled([this.view.setPhoto(image, width, height), this.view.setModel(urlOf(cad))]);
    this.active.value = detail.id;
    review.drawn.value = "";
    const [photo, model] = await shown;
    if (turn !== this.turn) return;
    this.loading.value = false;
    if (photo.status === "rejected") this.trouble.value = `The photo cannot be shown: ${sentence(photo.reason)}`;
    else if (model.status === "rejected") this.trouble.value = `The model cannot be shown: ${sentence(model.reason)}`;
    else this.trouble.value = missing(detail, cad);
    // The view draws in the next frame; the one after that begins when it has been handed on.
    requestAnimationFrame(() =>
      requestAnimationFrame(() => {
        if (turn !== this.turn) return;
        review.drawn.value = detail.id;
        performance.measure("cadpose-open", "cadpose-open");
        this.measure();
      }),
    );
  }

  private async clear(): Promise<void> {
    this.turn++;
    this.active.value = "";
    this.app.review.drawn.value = "";
    this.trouble.value = "";
    this.loading.value = false;
    await Promise.allSettled([this.view.setPhoto(null, 4, 3), this.view.setModel(null)]);
  }

  private async change(cad: Cad): Promise<void> {
    if (cad.key === this.model) return;
    this.model = cad.key;
    try {
      await this.view.setModel(urlOf(cad));
      if (this.model === cad.key) this.trouble.value = cad.available ? "" : NOT_THERE;
    } catch (error) {
      if (this.model === cad.key) this.trouble.value = `The model cannot be shown: ${sentence(error)}`;
    }
    this.measure();
  }

  /** The IoU with every frame where the graphics card is quick, else once the model rests. */
  private measure(): void {
    cancelAnimationFrame(this.frame);
    clearTimeout(this.timer);
    const run = (): void => {
      const begun = performance.now();
      this.app.review.iou.value = this.view.fitMask();
      this.cost = performance.now() - begun;
    };
    if (this.cost < QUICK_MS) this.frame = requestAnimationFrame(run);
    else this.timer = window.setTimeout(run, REST_MS);
  }
}

const NOT_THERE = "This model is not in the library that is open: start with `--library DIR`.";

function urlOf(cad: Cad): string | null {
  return cad.available ? meshUrl(cad.key) : null;
}

function missing(detail: Detail, cad: Cad): string {
  if (!detail.photo.image) return "The photo is not at hand: start with `--photos DIR`, the folder it lies in.";
  return cad.available ? "" : NOT_THERE;
}
