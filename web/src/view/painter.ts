/** Draws the canvas: the photo, the model in it and what tells them apart. */
import * as THREE from "three";

import type { Window } from "./camera";
import { ACROSS, ALONG, COMPOSITE, MODE, REACH } from "./composite";
import type { Model } from "./model";
import { Pass } from "./pass";
import type { Display, Pose } from "./pose";

export interface Picture {
  photo: THREE.Texture | null;
  /** Of the photo in its own pixels. */
  width: number;
  height: number;
  /** What part of the photo the canvas shows. */
  window: Window;
  model: Model | null;
  pose: Pose | null;
  before: Pose | null;
  mask: THREE.Texture | null;
  display: Display;
  opacity: number;
  /** Share of the canvas, from the left, that shows `before`. */
  wipe: number | null;
}

type Colour = readonly [number, number, number];

/** annotations/style.py's first two. */
const TINT: Colour = [1, 128 / 255, 0];
const BEFORE: Colour = [0, 158 / 255, 1];
const MULTISAMPLED = 4;
/** Of the outline and of the rim about it, in pixels of the page; annotations/marks.py at a common size. */
const HALF_WIDTH = 1.0;
const RIM = 1.1;

export class Painter {
  private readonly layer = target({ samples: MULTISAMPLED, stencilBuffer: true });
  private readonly lines = target({ samples: MULTISAMPLED });
  private readonly along = target({ depthBuffer: false });
  private readonly outline = target({ depthBuffer: false });
  private readonly alongPass = new Pass(ALONG, { layer: this.layer.texture, reach: REACH });
  private readonly acrossPass = new Pass(ACROSS, {
    layer: this.layer.texture,
    along: this.along.texture,
    reach: REACH,
  });
  private readonly composite = new Pass(COMPOSITE, {
    photo: null,
    hasPhoto: false,
    layer: this.layer.texture,
    lines: this.lines.texture,
    outline: this.outline.texture,
    mask: null,
    hasMask: false,
    hasModel: false,
    mode: 0,
    opacity: 1,
    tint: new THREE.Vector3(),
    reach: REACH,
    outlineWidths: new THREE.Vector2(),
    size: new THREE.Vector2(),
    place: new THREE.Vector4(),
    texel: 1,
  });
  private readonly size = new THREE.Vector2(1, 1);

  constructor(private readonly renderer: THREE.WebGLRenderer) {}

  /** `ratio`: canvas pixels of a pixel of the page. */
  draw(picture: Picture, ratio: number): void {
    const { renderer, size } = this;
    renderer.getDrawingBufferSize(size);
    const { wipe } = picture;
    const divider = wipe === null ? 0 : Math.round(wipe * size.x);
    renderer.setRenderTarget(null);
    renderer.setClearColor(0, 0);
    renderer.clear();
    if (divider > 0) this.part(picture, picture.before, BEFORE, 0, divider, ratio);
    if (divider < size.x) this.part(picture, picture.pose, TINT, divider, size.x - divider, ratio);
  }

  dispose(): void {
    for (const kept of [this.layer, this.lines, this.along, this.outline]) kept.dispose();
    for (const pass of [this.alongPass, this.acrossPass, this.composite]) pass.dispose();
  }

  /** The columns from `left` on, with the model at that pose. */
  private part(
    picture: Picture, pose: Pose | null, tint: Colour, left: number, width: number, ratio: number,
  ): void {
    const { renderer, size, composite } = this;
    const { model, window, display } = picture;
    const hasModel = model !== null && pose !== null && display !== "photo";
    if (hasModel) this.drawModel(model, pose, picture, left, width, ratio);
    const across = size.x / window.width;
    const shown = picture.photo?.image as { width: number } | undefined;
    composite.set({
      photo: picture.photo,
      hasPhoto: picture.photo !== null,
      mask: picture.mask,
      hasMask: picture.mask !== null,
      hasModel,
      mode: MODE[display],
      opacity: picture.opacity,
      tint: new THREE.Vector3(...tint),
      outlineWidths: new THREE.Vector2(HALF_WIDTH * ratio, (HALF_WIDTH + RIM) * ratio),
      size,
      place: new THREE.Vector4(
        -window.x * across,
        -window.y * across,
        picture.width * across,
        picture.height * across,
      ),
      texel: shown ? (picture.width * across) / shown.width : 1,
    });
    // The canvas's own scissor is in pixels of the page.
    renderer.setScissor(left / ratio, 0, width / ratio, size.y / ratio);
    renderer.setScissorTest(true);
    composite.draw(renderer, null);
    renderer.setScissorTest(false);
  }

  private drawModel(
    model: Model, pose: Pose, picture: Picture, left: number, width: number, ratio: number,
  ): void {
    const { renderer, size, layer, lines, along, outline } = this;
    const { display } = picture;
    // A little more than is shown, as outlines reach that far.
    const from = Math.max(0, left - REACH - 1);
    const to = Math.min(size.x, left + width + REACH + 1);
    for (const each of [layer, lines, along, outline]) {
      if (each.width !== size.x || each.height !== size.y) each.setSize(size.x, size.y);
      each.scissorTest = true;
      each.scissor.set(from, 0, to - from, size.y);
    }
    model.aim(pose, picture.window);
    renderer.setRenderTarget(layer);
    renderer.setClearColor(0, 0);
    renderer.clear();
    model.draw(renderer, "shaded");
    if (display === "blend" || display === "outline") {
      this.alongPass.draw(renderer, along);
      this.acrossPass.draw(renderer, outline);
    }
    if (display === "outline" || display === "wireframe") {
      renderer.setRenderTarget(lines);
      renderer.clear();
      const edges = model.edgeLines(display === "outline" ? "creases" : "wires");
      if (display === "wireframe") edges.draw(renderer, size, ratio, 0.16, true);
      model.draw(renderer, "depth");
      edges.draw(renderer, size, display === "outline" ? 1.2 * ratio : ratio, display === "outline" ? 0.8 : 0.9, false);
    }
  }
}

function target(options: THREE.RenderTargetOptions): THREE.WebGLRenderTarget {
  return new THREE.WebGLRenderTarget(1, 1, {
    minFilter: THREE.NearestFilter,
    magFilter: THREE.NearestFilter,
    ...options,
  });
}
