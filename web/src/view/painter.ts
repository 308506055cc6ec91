/** Draws the canvas: the photo, the model in it and what tells them apart. */
import * as THREE from "three";

import { projectedBox, type Window } from "./camera";
import { ACROSS, ALONG, COMPOSITE, MODE } from "./composite";
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

const NOWHERE = new THREE.Vector4();

export class Painter {
  private readonly layer = target({ samples: MULTISAMPLED, stencilBuffer: true });
  /** Lines have soft edges of their own. */
  private readonly lines = target({});
  private readonly along = target({ depthBuffer: false });
  private readonly outline = target({ depthBuffer: false });
  private readonly alongPass = new Pass(ALONG, { layer: this.layer.texture, reach: 0, area: NOWHERE });
  private readonly acrossPass = new Pass(ACROSS, {
    layer: this.layer.texture,
    along: this.along.texture,
    reach: 0,
    area: NOWHERE,
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
    reach: 0,
    outlineWidths: new THREE.Vector2(),
    size: new THREE.Vector2(),
    place: new THREE.Vector4(),
    area: NOWHERE,
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
    // How far from the silhouette its rim goes.
    const reach = Math.ceil((HALF_WIDTH + RIM) * ratio + 1);
    const drawn = model && pose && display !== "photo" ? { model, pose } : null;
    const area = drawn ? areaOf(drawn.model, drawn.pose, window, size, [left, left + width], reach) : NOWHERE;
    const hasModel = drawn !== null && area.z > area.x && area.w > area.y;
    if (hasModel) this.drawModel(drawn.model, drawn.pose, picture, area, reach, ratio);
    const across = size.x / window.width;
    const shown = picture.photo?.image as { width: number } | undefined;
    composite.set({
      photo: picture.photo,
      hasPhoto: picture.photo !== null,
      mask: picture.mask,
      hasMask: picture.mask !== null,
      hasModel,
      area,
      reach,
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
    model: Model, pose: Pose, picture: Picture, area: THREE.Vector4, reach: number, ratio: number,
  ): void {
    const { renderer, size, layer, lines, along, outline } = this;
    const { display } = picture;
    for (const each of [layer, lines, along, outline]) {
      if (each.width !== size.x || each.height !== size.y) each.setSize(size.x, size.y);
      each.scissorTest = true;
      each.scissor.set(area.x, area.y, area.z - area.x, area.w - area.y);
    }
    model.aim(pose, picture.window);
    renderer.setRenderTarget(layer);
    renderer.setClearColor(0, 0);
    renderer.clear();
    model.draw(renderer, "shaded");
    if (display === "blend" || display === "outline") {
      this.alongPass.set({ reach, area });
      this.acrossPass.set({ reach, area });
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

/** What of the canvas the model and its rim take, within these columns: left, bottom, right, top. */
function areaOf(
  model: Model, pose: Pose, window: Window, size: THREE.Vector2, columns: [number, number], reach: number,
): THREE.Vector4 {
  const scale = size.x / window.width;
  const box = projectedBox(pose, model.bounds);
  const low = (value: number, least: number): number => Math.max(least, Math.floor(value * scale) - reach - 1);
  const high = (value: number, most: number): number => Math.min(most, Math.ceil(value * scale) + reach + 1);
  const [from, to] = [Math.max(0, columns[0] - reach - 1), Math.min(size.x, columns[1] + reach + 1)];
  if (!box) return new THREE.Vector4(from, 0, to, size.y);
  return new THREE.Vector4(
    low(box[0] - window.x, from),
    size.y - high(box[3] - window.y, size.y),
    high(box[2] - window.x, to),
    size.y - low(box[1] - window.y, 0),
  );
}

function target(options: THREE.RenderTargetOptions): THREE.WebGLRenderTarget {
  return new THREE.WebGLRenderTarget(1, 1, {
    minFilter: THREE.NearestFilter,
    magFilter: THREE.NearestFilter,
    ...options,
  });
}
