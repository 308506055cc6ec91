/** The lines and handles of a region that is being edited, as one SVG over the view. */
import type { Point } from "./camera";
import type { Ring } from "./polygon";
import type { Box } from "./pose";
import type { BoxHandle } from "./region";

/** What the pointer or the keyboard holds. */
export type Target =
  | { kind: "whole" }
  | { kind: "box"; handle: BoxHandle }
  | { kind: "point"; ring: number; index: number };

export interface Shown {
  box: Box | null;
  handles: readonly (readonly [BoxHandle, Point | null])[];
  rings: readonly Ring[];
  /** Whether the rings' points can be held. */
  points: boolean;
  draft: Ring | null;
  /** A mask that is being brushed. */
  stroke: Uint8Array | null;
  size: Point;
  /** In pixels of the page. */
  brush: { at: Point; radius: number } | null;
  cursor: string;
}

const NAMES: Record<BoxHandle, string> = {
  nw: "top left corner", n: "top edge", ne: "top right corner", e: "right edge",
  se: "bottom right corner", s: "bottom edge", sw: "bottom left corner", w: "left edge",
}; // prettier-ignore
const CURSORS: Record<BoxHandle, string> = {
  nw: "nwse-resize", n: "ns-resize", ne: "nesw-resize", e: "ew-resize",
  se: "nwse-resize", s: "ns-resize", sw: "nesw-resize", w: "ew-resize",
}; // prettier-ignore
const BOX_COLOUR = "#ffd43b";
const MASK_COLOUR = "#4dabf7";
const HANDLE = 6;
const POINT = 5;
const SVG = "http://www.w3.org/2000/svg";

export class Sketch {
  readonly root: SVGSVGElement;
  private readonly targets = new Map<Element, Target>();
  private readonly kept = new Map<string, SVGElement>();
  private used = new Set<string>();
  private readonly canvas: HTMLCanvasElement;

  constructor(
    private readonly container: HTMLElement,
    private readonly toScreen: (point: Point) => Point,
  ) {
    const { ownerDocument } = container;
    this.canvas = ownerDocument.createElement("canvas");
    this.root = ownerDocument.createElementNS(SVG, "svg") as SVGSVGElement;
    for (const element of [this.canvas, this.root]) {
      Object.assign(element.style, { position: "absolute", left: "0", top: "0" });
    }
    this.canvas.style.pointerEvents = "none";
    this.canvas.style.opacity = "0.45";
    Object.assign(this.root.style, { width: "100%", height: "100%", touchAction: "none", overflow: "hidden" });
    this.root.setAttribute("role", "group");
    this.root.setAttribute("aria-label", "Box and mask");
    container.append(this.canvas, this.root);
  }

  draw(shown: Shown): void {
    this.used = new Set();
    this.root.style.cursor = shown.cursor;
    this.drawStroke(shown);
    if (shown.rings.length && !shown.stroke) this.drawRings(shown.rings);
    if (shown.box) this.drawBox(shown.box, shown.handles.length > 0);
    for (const [handle, at] of shown.handles) if (at) this.drawHandle(handle, at);
    if (shown.points) {
      shown.rings.forEach((ring, r) => ring.forEach((point, i) => this.drawPoint(r, i, ring.length, point)));
    }
    if (shown.draft?.length) {
      this.lines("draft", [shown.draft], false);
      const [x, y] = this.toScreen(shown.draft[0]);
      this.put("draft start", "circle", { cx: x, cy: y, r: POINT, fill: MASK_COLOUR, stroke: "#000" });
    }
    if (shown.brush) {
      const [x, y] = this.toScreen(shown.brush.at);
      const look = { fill: "none", "pointer-events": "none" };
      this.put("brush rim", "circle", { cx: x, cy: y, r: shown.brush.radius, stroke: "#000", "stroke-width": 3, ...look });
      this.put("brush", "circle", { cx: x, cy: y, r: shown.brush.radius, stroke: "#fff", ...look });
    }
    for (const [name, element] of this.kept) {
      if (this.used.has(name)) continue;
      element.remove();
      this.kept.delete(name);
      this.targets.delete(element);
    }
  }

  targetOf(element: EventTarget | null): Target | null {
    return (element instanceof Element && this.targets.get(element)) || null;
  }

  focused(): Target | null {
    return this.targetOf(this.container.ownerDocument.activeElement);
  }

  focus(target: Target): void {
    for (const [element, held] of this.targets) {
      const same = JSON.stringify(held) === JSON.stringify(target);
      if (same) (element as SVGElement).focus();
    }
  }

  dispose(): void {
    this.root.remove();
    this.canvas.remove();
  }

  private drawBox([x0, y0, x1, y1]: Box, held: boolean): void {
    const [left, top] = this.toScreen([x0, y0]);
    const [right, bottom] = this.toScreen([x1, y1]);
    const place = { x: left, y: top, width: Math.max(right - left, 0), height: Math.max(bottom - top, 0) };
    const none = { fill: "none", "pointer-events": "none" };
    this.put("box rim", "rect", { ...place, stroke: "#000", "stroke-opacity": 0.6, "stroke-width": 4, ...none });
    const box = this.put("box", "rect", { ...place, stroke: BOX_COLOUR, "stroke-width": 2, ...none });
    box.style.cursor = "";
    if (!held) {
      this.targets.delete(box);
      box.removeAttribute("tabindex");
      return;
    }
    // Held at its lines only: a new box may start inside.
    box.setAttribute("pointer-events", "stroke");
    box.style.cursor = "move";
    this.hold(box, { kind: "whole" }, "Whole box");
  }

  private drawHandle(handle: BoxHandle, at: Point): void {
    const [x, y] = this.toScreen(at);
    const look = { width: 2 * HANDLE, height: 2 * HANDLE, fill: BOX_COLOUR, stroke: "#000" };
    const element = this.put(`handle ${handle}`, "rect", { x: x - HANDLE, y: y - HANDLE, ...look });
    element.style.cursor = CURSORS[handle];
    this.hold(element, { kind: "box", handle }, `Box, ${NAMES[handle]}`);
  }

  private drawRings(rings: readonly Ring[]): void {
    this.lines("rings", rings, true);
  }

  private drawPoint(ring: number, index: number, count: number, point: Point): void {
    const [x, y] = this.toScreen(point);
    const look = { r: POINT, fill: MASK_COLOUR, stroke: "#000" };
    const element = this.put(`point ${ring} ${index}`, "circle", { cx: x, cy: y, ...look });
    element.style.cursor = "move";
    this.hold(element, { kind: "point", ring, index }, `Polygon ${ring + 1}, point ${index + 1} of ${count}`);
  }

  private lines(name: string, rings: readonly Ring[], closed: boolean): void {
    const d = rings.map((ring) => `M${ring.map((p) => this.toScreen(p).join(" ")).join("L")}${closed ? "Z" : ""}`).join("");
    const none = { "pointer-events": "none" };
    this.put(`${name} rim`, "path", {
      d, fill: "none", stroke: "#000", "stroke-opacity": 0.6, "stroke-width": 3.5, ...none,
    }); // prettier-ignore
    this.put(name, "path", {
      d, fill: closed ? MASK_COLOUR : "none", "fill-opacity": 0.25, "fill-rule": "evenodd",
      stroke: MASK_COLOUR, "stroke-width": 1.5, ...none,
    }); // prettier-ignore
  }

  /** Pixel by pixel while it is brushed. */
  private drawStroke({ stroke, size }: Shown): void {
    this.canvas.style.display = stroke ? "block" : "none";
    if (!stroke) return;
    const [width, height] = size;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const [left, top] = this.toScreen([0, 0]);
    const [right, bottom] = this.toScreen(size);
    Object.assign(this.canvas.style, {
      left: `${left}px`,
      top: `${top}px`,
      width: `${right - left}px`,
      height: `${bottom - top}px`,
    });
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const image = context.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    // MASK_COLOUR, alpha highest.
    for (let i = 0; i < stroke.length; i++) if (stroke[i]) pixels[i] = 0xfff7ab4d;
    context.putImageData(image, 0, 0);
  }

  private hold(element: SVGElement, target: Target, label: string): void {
    this.targets.set(element, target);
    element.setAttribute("tabindex", "0");
    element.setAttribute("role", "button");
    element.setAttribute("aria-label", label);
  }

  /** Elements stay where they can, so that the keyboard's place stays. */
  private put(name: string, kind: string, attributes: Record<string, string | number>): SVGElement {
    let element = this.kept.get(name);
    if (!element) {
      element = this.container.ownerDocument.createElementNS(SVG, kind) as SVGElement;
      this.kept.set(name, element);
      this.root.append(element);
    }
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
    this.used.add(name);
    return element;
  }
}
