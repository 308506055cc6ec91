/** A photo with a CAD model drawn over it by the camera of a pose, which gestures change. */
import * as THREE from "three";

import type { Point } from "./camera";
import { Frame } from "./frame";
import { Gestures } from "./gestures";
import { maskTexture, models, photos } from "./loading";
import { Model } from "./model";
import { Painter, type Picture } from "./painter";
import type { Box, Display, Pose } from "./pose";
import { Silhouettes } from "./silhouette";
import { Wipe } from "./wipe";

export type { Box, Display, Pose } from "./pose";

export interface PhotoViewOptions {
  /** The pose was changed by hand; `done` when the hand let go. */
  onPose(pose: Pose, done: boolean): void;
  /** Whether gestures must leave the pose alone for now. */
  paused?(): boolean;
  /** The divider was moved, 0 at the left. */
  onWipe?(wipe: number): void;
  /** The photo was enlarged or moved, or the container changed its size. */
  onView?(): void;
}

export interface Silhouette {
  width: number;
  height: number;
  /** 0 or 1, row by row. */
  data: Uint8Array;
}

/** Pixels that fitMask draws at most. */
const FIT_PIXELS = 1_000_000;
/** Radius in pixels of the page at which an object is easy to hold. */
const LEAST_RADIUS = 90;
const NO_WEBGL =
  "This browser shows no WebGL 2, which draws the model over the photo. Turn on hardware acceleration, or use another browser.";
const LOST = "The graphics card was reset. The picture comes back as soon as it answers.";

const viewOn = new WeakMap<HTMLElement, PhotoView>();

export class PhotoView {
  /** False where the browser has no WebGL 2; the container says so. */
  readonly available: boolean;
  private readonly canvas: HTMLCanvasElement;
  private readonly notice: HTMLElement;
  private readonly renderer: THREE.WebGLRenderer | null;
  private readonly painter: Painter | null = null;
  private silhouettes: Silhouettes | null = null;
  private readonly frame = new Frame();
  private readonly wipe: Wipe;
  private readonly gestures: Gestures;
  private readonly resized: ResizeObserver;
  private readonly watchers = new Set<() => void>();
  private readonly off = new AbortController();
  private readonly picture: Picture = {
    photo: null,
    width: 1,
    height: 1,
    window: this.frame.window,
    model: null,
    pose: null,
    before: null,
    mask: null,
    display: "blend",
    opacity: 0.62,
    wipe: null,
  };
  private mask: Uint8Array | null = null;
  private maskPixels = 0;
  /** Of a model that no cache keeps. */
  private ownModel: Model | null = null;
  private wantedPhoto = 0;
  private wantedModel = 0;
  private drawing = 0;
  private interactive = true;
  private lost = false;
  private disposed = false;

  constructor(
    private readonly container: HTMLElement,
    private readonly options: PhotoViewOptions,
  ) {
    const { ownerDocument } = container;
    this.canvas = ownerDocument.createElement("canvas");
    this.notice = ownerDocument.createElement("p");
    this.notice.setAttribute("role", "alert");
    Object.assign(this.canvas.style, { position: "absolute", inset: "0", width: "100%", height: "100%" });
    Object.assign(this.notice.style, {
      position: "absolute",
      inset: "auto 1rem 1rem 1rem",
      margin: "0",
      padding: "0.75rem 1rem",
      borderRadius: "0.5rem",
      background: "#1d2127",
      color: "#fff",
      display: "none",
    });
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "The photo with the CAD model drawn over it");
    container.append(this.canvas, this.notice);
    this.renderer = rendererOn(this.canvas);
    this.available = this.renderer !== null;
    if (this.renderer) this.painter = new Painter(this.renderer);
    else this.say(NO_WEBGL);

    this.wipe = new Wipe(container, (share) => {
      this.picture.wipe = share;
      this.invalidate();
      options.onWipe?.(share);
    });
    this.gestures = new Gestures(this.canvas, {
      pose: () => this.picture.pose,
      change: (pose, done) => {
        this.setPose(pose);
        options.onPose(pose, done);
      },
      toPhoto: (client) => this.toPhoto(this.inside(client)),
      pan: (dx, dy) => this.panBy(dx, dy),
      zoom: (factor, client) => this.zoomBy(factor, this.inside(client)),
      interactive: () => this.interactive,
      paused: () => options.paused?.() ?? false,
      leastRadius: () => LEAST_RADIUS / this.frame.scale,
    });
    const { signal } = this.off;
    this.canvas.addEventListener("webglcontextlost", (event) => this.onLost(event), { signal });
    this.canvas.addEventListener("webglcontextrestored", () => this.onRestored(), { signal });
    this.resized = new ResizeObserver(() => this.fitContainer());
    this.resized.observe(container);
    this.fitContainer();
    this.watchRatio();
    viewOn.set(container, this);
  }

  /** The view that lives on a container. */
  static on(container: HTMLElement): PhotoView | null {
    return viewOn.get(container) ?? null;
  }

  /** Photos and models that are shown next: they are loaded, and kept for then. */
  async preload(photo: string | null, model: string | null): Promise<void> {
    const wanted: Promise<unknown>[] = [];
    if (photo !== null) wanted.push(photos.get(photo));
    if (model !== null) wanted.push(models.get(model));
    await Promise.allSettled(wanted);
  }

  /**
   * Show a photo of that size; its picture may be smaller. Null shows grey in its place. The mask goes.
   * Throws an Error where the picture cannot be loaded.
   */
  async setPhoto(url: string | null, width: number, height: number): Promise<void> {
    const wanted = ++this.wantedPhoto;
    this.setMask(null);
    this.picture.photo = null;
    this.picture.width = width;
    this.picture.height = height;
    this.frame.setPhoto(width, height);
    this.tellView();
    if (url === null || !this.available) return;
    const photo = await photos.get(url);
    if (wanted !== this.wantedPhoto || this.disposed) return;
    this.picture.photo = photo;
    this.invalidate();
  }

  /** Show a model: the address or the bytes of a .glb. Throws an Error where it cannot be loaded. */
  async setModel(source: string | ArrayBuffer | null): Promise<void> {
    const wanted = ++this.wantedModel;
    const own = this.ownModel;
    if (source === null || !this.available) {
      this.picture.model = this.ownModel = null;
    } else {
      const model = typeof source === "string" ? await models.get(source) : await Model.from(source);
      if (wanted !== this.wantedModel || this.disposed) return;
      this.picture.model = model;
      this.ownModel = typeof source === "string" ? null : model;
    }
    own?.dispose();
    this.invalidate();
  }

  setPose(pose: Pose): void {
    this.picture.pose = pose;
    this.invalidate();
  }

  /** The pose at the left of the divider; null shows the photo alone there. */
  setBefore(pose: Pose | null): void {
    this.picture.before = pose;
    this.invalidate();
  }

  /** width * height of the photo, 0 or 1, row by row. */
  setMask(mask: Uint8Array | null): void {
    const { width, height } = this.picture;
    if (mask && mask.length !== width * height) {
      throw new Error(`a mask of ${width} x ${height} has ${width * height} values, not ${mask.length}`);
    }
    this.picture.mask?.dispose();
    this.mask = mask;
    this.maskPixels = mask ? mask.reduce((sum, value) => sum + (value ? 1 : 0), 0) : 0;
    this.picture.mask = mask ? maskTexture(mask, width, height) : null;
    this.invalidate();
  }

  /** `wipe`: where the divider is, 0 at the left; null without one. */
  setDisplay(display: Display, opacity: number, wipe: number | null): void {
    Object.assign(this.picture, { display, opacity, wipe });
    this.wipe.show(wipe);
    this.invalidate();
  }

  /** Ends what is held, and tells the pose that it has now. */
  finish(): void {
    this.gestures.finish();
  }

  /** Whether gestures change the pose; the photo can be enlarged and moved in any case. */
  setInteractive(interactive: boolean): void {
    this.gestures.finish();
    this.interactive = interactive;
  }

  /** Intersection over union of silhouette and mask; null without one of them. */
  fitMask(): number | null {
    const { model, pose, width, height } = this.picture;
    if (!this.renderer || this.lost || !model || !pose || !this.mask) return null;
    this.silhouettes ??= new Silhouettes(this.renderer);
    const { both, drawn } = this.silhouettes.overlap(model, pose, this.mask, width, height, FIT_PIXELS);
    const union = this.maskPixels + drawn - both;
    return union > 0 ? Math.min(1, both / union) : 0;
  }

  /** The model's silhouette at the photo's size; nothing without a model and a pose. */
  silhouette(): Silhouette {
    const { model, pose, width, height } = this.picture;
    if (!this.renderer || this.lost) throw new Error(this.lost ? LOST : NO_WEBGL);
    if (!model || !pose) return { width, height, data: new Uint8Array(width * height) };
    this.silhouettes ??= new Silhouettes(this.renderer);
    return { width, height, data: this.silhouettes.whole(model, pose, width, height) };
  }

  /** How many times larger than a photo that fits the container. */
  get zoom(): number {
    return this.frame.zoom;
  }

  /** The photo's width and height. */
  get photoSize(): [number, number] {
    return [this.picture.width, this.picture.height];
  }

  /** About a point of the container, or about its middle. */
  zoomBy(factor: number, at?: Point): void {
    this.frame.zoomAt(factor, at ?? [this.container.clientWidth / 2, this.container.clientHeight / 2]);
    this.tellView();
  }

  panBy(dx: number, dy: number): void {
    this.frame.pan(dx, dy);
    this.tellView();
  }

  /** Enlarge a part of the photo; null shows all of it. */
  focusOn(box: Box | null): void {
    if (box) this.frame.focus(box);
    else this.frame.fit();
    this.tellView();
  }

  /** From pixels of the container to pixels of the photo. */
  toPhoto(point: Point): [number, number] {
    return this.frame.toPhoto(point);
  }

  /** From pixels of the photo to pixels of the container. */
  toScreen(point: Point): [number, number] {
    return this.frame.toScreen(point);
  }

  /** Be called when the photo moves on the page; gives what ends that. */
  watch(watcher: () => void): () => void {
    this.watchers.add(watcher);
    return () => this.watchers.delete(watcher);
  }

  /** Draw at once what is to be drawn. */
  drawNow(): void {
    cancelAnimationFrame(this.drawing);
    this.drawing = 0;
    if (!this.renderer || !this.painter || this.lost || this.disposed) return;
    this.picture.window = this.frame.window;
    this.painter.draw(this.picture, this.renderer.getPixelRatio());
  }

  /** Frees the graphics card's memory and takes the view off the page. */
  dispose(): void {
    if (this.disposed) return;
    this.disposed = true;
    cancelAnimationFrame(this.drawing);
    this.off.abort();
    this.resized.disconnect();
    this.gestures.dispose();
    this.picture.mask?.dispose();
    this.picture.photo?.dispose();
    this.picture.model?.dispose();
    this.silhouettes?.dispose();
    this.painter?.dispose();
    this.renderer?.dispose();
    this.renderer?.forceContextLoss();
    for (const element of [this.canvas, this.notice, this.wipe.element]) element.remove();
    viewOn.delete(this.container);
  }

  private inside([x, y]: Point): Point {
    const { left, top } = this.container.getBoundingClientRect();
    return [x - left - this.container.clientLeft, y - top - this.container.clientTop];
  }

  private invalidate(): void {
    if (this.drawing === 0 && !this.disposed) this.drawing = requestAnimationFrame(() => this.drawNow());
  }

  private tellView(): void {
    this.invalidate();
    for (const watcher of this.watchers) watcher();
    this.options.onView?.();
  }

  private fitContainer(): void {
    const [width, height] = [this.container.clientWidth, this.container.clientHeight];
    this.frame.resize(width, height);
    if (this.renderer) {
      this.renderer.setPixelRatio(this.canvas.ownerDocument.defaultView?.devicePixelRatio ?? 1);
      this.renderer.setSize(Math.max(width, 1), Math.max(height, 1), false);
      // A canvas of a new size is empty until it is drawn.
      this.drawNow();
    }
    this.tellView();
  }

  /** The page may go to another screen. */
  private watchRatio(): void {
    const ratio = window.devicePixelRatio;
    window
      .matchMedia(`(resolution: ${ratio}dppx)`)
      .addEventListener("change", () => (this.fitContainer(), this.watchRatio()), {
        once: true,
        signal: this.off.signal,
      });
  }

  private onLost(event: Event): void {
    event.preventDefault();
    this.lost = true;
    if (!this.disposed) this.say(LOST);
  }

  private onRestored(): void {
    this.lost = false;
    this.say("");
    this.invalidate();
  }

  private say(text: string): void {
    this.notice.textContent = text;
    this.notice.style.display = text ? "block" : "none";
  }
}

function rendererOn(canvas: HTMLCanvasElement): THREE.WebGLRenderer | null {
  // Asked first: three writes to the console where there is none.
  const context = canvas.getContext("webgl2", { alpha: true, antialias: false, depth: false, stencil: false });
  if (!context) return null;
  const renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true });
  renderer.autoClear = false;
  return renderer;
}
