/** Draws and mends the box and the mask of a detection over a PhotoView, with mouse, finger or keys. */
import type { Point } from "./camera";
import { PhotoView } from "./photo_view";
import type { Ring } from "./polygon";
import type { Box } from "./pose";
import { BOX_HANDLES, type BoxHandle, closesRing, Region } from "./region";
import { Sketch, type Target } from "./region_sketch";

export type Tool = "box" | "polygon" | "brush" | "erase";

export interface RegionEditorOptions {
  /** After each change: the box, and the mask of the photo's size, 0 or 1, row by row. */
  onChange(box: Box | null, mask: Uint8Array | null): void;
}

/** How close to an edge a click adds a point, in pixels of the page. */
const EDGE_REACH = 8;

type Drag =
  | { kind: "new box"; from: Point }
  | { kind: "box"; handle: BoxHandle }
  | { kind: "whole box"; from: Point }
  | { kind: "point"; ring: number; index: number }
  | { kind: "stroke"; from: Point; value: 0 | 1 }
  | { kind: "pan"; from: Point };

export class RegionEditor {
  /** Radius of the brush in pixels of the photo. */
  brushSize: number;
  private readonly view: PhotoView;
  private state: Region;
  private readonly sketch: Sketch;
  private tool: Tool = "box";
  private drag: Drag | null = null;
  private changed = false;
  private draft: Ring | null = null;
  private pointer: Point | null = null;
  private space = false;
  private readonly off = new AbortController();
  private readonly unwatch: () => void;

  constructor(
    private readonly container: HTMLElement,
    private readonly options: RegionEditorOptions,
  ) {
    const view = PhotoView.on(container);
    if (!view) throw new Error("a region is edited over a PhotoView, and the container holds none");
    this.view = view;
    view.setInteractive(false);
    this.state = new Region(...view.photoSize);
    this.brushSize = Math.max(3, Math.round(Math.max(...view.photoSize) / 80));
    this.sketch = new Sketch(container, (point) => view.toScreen(point));
    const { root } = this.sketch;
    const { signal } = this.off;
    root.addEventListener("pointerdown", (event) => this.down(event), { signal });
    root.addEventListener("pointermove", (event) => this.move(event), { signal });
    root.addEventListener("pointerup", (event) => this.up(event), { signal });
    root.addEventListener("pointercancel", (event) => this.up(event), { signal });
    root.addEventListener("dblclick", (event) => this.doubleClick(event), { signal });
    root.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
    root.addEventListener("keydown", (event) => this.key(event), { signal });
    root.addEventListener("wheel", (event) => this.wheel(event), { signal, passive: false });
    const { ownerDocument } = container;
    for (const name of ["keydown", "keyup"] as const) {
      ownerDocument.addEventListener(name, (event) => this.spaceKey(event), { signal });
    }
    this.unwatch = view.watch(() => this.draw());
    this.draw();
  }

  /** Start from a box and a mask of the photo's size; nothing is told. */
  setRegion(box: Box | null, mask: Uint8Array | null): void {
    this.state = new Region(...this.view.photoSize);
    this.state.reset(box ? [...box] : null, mask ? mask.slice() : null);
    this.draft = this.drag = null;
    this.draw();
  }

  region(): { box: Box | null; mask: Uint8Array | null } {
    return { box: this.state.box, mask: this.state.mask };
  }

  setTool(tool: Tool): void {
    this.closeDraft();
    this.tool = tool;
    this.draw();
  }

  /** Clicks make the points of a further ring; Enter, a double click or a click on the first point closes it. */
  newRing(): void {
    this.closeDraft();
    this.tool = "polygon";
    this.draft = [];
    this.draw();
  }

  /** The point that has the keyboard. */
  deleteSelected(): void {
    const target = this.sketch.focused();
    if (target?.kind !== "point") return;
    this.change(() => this.state.deletePoint(target.ring, target.index));
    const left = this.state.rings[target.ring]?.length ?? 0;
    if (left) this.sketch.focus({ ...target, index: Math.min(target.index, left - 1) });
  }

  undo(): void {
    if (this.state.undo()) this.tell();
  }

  redo(): void {
    if (this.state.redo()) this.tell();
  }

  dispose(): void {
    this.off.abort();
    this.unwatch();
    this.sketch.dispose();
    this.view.setInteractive(true);
  }

  private down(event: PointerEvent): void {
    event.preventDefault();
    this.sketch.root.setPointerCapture(event.pointerId);
    const at = this.photoAt(event);
    const target = this.sketch.targetOf(event.target);
    if (event.button === 1 || this.space) {
      this.drag = { kind: "pan", from: [event.clientX, event.clientY] };
      return;
    }
    if (event.button !== 0) return;
    if (target) this.sketch.focus(target);
    if (this.draft) this.addToDraft(at);
    else if (this.tool === "box") this.startBox(at, target);
    else if (this.tool === "polygon") this.startPoint(at, target);
    else this.startStroke(at);
    this.draw();
  }

  private startBox(at: Point, target: Target | null): void {
    this.state.mark();
    if (target?.kind === "box") this.drag = { kind: "box", handle: target.handle };
    else if (target?.kind === "whole") this.drag = { kind: "whole box", from: at };
    else this.drag = { kind: "new box", from: at };
  }

  private startPoint(at: Point, target: Target | null): void {
    if (target?.kind === "point") {
      this.state.mark();
      this.drag = { ...target };
      return;
    }
    const edge = this.state.nearestEdge(at, EDGE_REACH / this.pixel());
    if (edge) {
      this.state.mark();
      const index = this.state.insertPoint(edge.ring, edge.after, at);
      this.drag = { kind: "point", ring: edge.ring, index };
      this.changed = true;
    } else if (!this.state.rings.length) {
      this.draft = [[at[0], at[1]]];
    }
  }

  private startStroke(at: Point): void {
    this.state.mark();
    const value = this.tool === "brush" ? 1 : 0;
    this.drag = { kind: "stroke", from: at, value };
    this.state.brush(at, at, this.brushSize, value);
    this.changed = true;
  }

  private addToDraft(at: Point): void {
    if (!this.draft) return;
    if (closesRing(this.draft, at, EDGE_REACH / this.pixel())) this.closeDraft();
    else this.draft.push([at[0], at[1]]);
  }

  private move(event: PointerEvent): void {
    const at = this.photoAt(event);
    this.pointer = at;
    const { drag } = this;
    if (drag?.kind === "pan") {
      this.view.panBy(event.clientX - drag.from[0], event.clientY - drag.from[1]);
      drag.from = [event.clientX, event.clientY];
      return;
    }
    if (drag) this.changed = true;
    if (drag?.kind === "new box") this.state.drawBox(drag.from, at);
    else if (drag?.kind === "box") this.state.dragBox(drag.handle, at);
    else if (drag?.kind === "point") this.state.movePoint(drag.ring, drag.index, at);
    else if (drag?.kind === "whole box") {
      this.state.shiftBox(at[0] - drag.from[0], at[1] - drag.from[1]);
      drag.from = at;
    } else if (drag?.kind === "stroke") {
      this.state.brush(drag.from, at, this.brushSize, drag.value);
      drag.from = at;
    }
    if (drag || this.draft || this.tool === "brush" || this.tool === "erase") this.draw();
  }

  private up(event: PointerEvent): void {
    const { drag } = this;
    this.drag = null;
    if (!drag || drag.kind === "pan") return;
    if (drag.kind === "stroke") this.state.endStroke();
    if (this.changed && event.type !== "pointercancel") this.tell();
    else this.state.undo();
    this.changed = false;
    this.draw();
  }

  private doubleClick(event: MouseEvent): void {
    // The event itself goes to what captured the pointer.
    const { ownerDocument } = this.container;
    const target = this.sketch.targetOf(ownerDocument.elementFromPoint(event.clientX, event.clientY));
    if (this.draft) this.closeDraft();
    else if (target?.kind === "point" && this.tool === "polygon") {
      this.change(() => this.state.deletePoint(target.ring, target.index));
    }
  }

  private key(event: KeyboardEvent): void {
    const target = this.sketch.focused();
    const step = event.shiftKey ? 10 : 1;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    let used = true;
    if (way && target) this.nudge(target, way[0] * step, way[1] * step);
    else if ((event.key === "Delete" || event.key === "Backspace") && target) this.deleteSelected();
    else if (event.key === "Insert" && target?.kind === "point") this.split(target.ring, target.index);
    else if (event.key === "Enter" && this.draft) this.closeDraft();
    else if (event.key === "Escape" && this.draft) this.draft = null;
    else used = false;
    if (!used) return;
    event.preventDefault();
    event.stopPropagation();
    this.draw();
  }

  private nudge(target: Target, dx: number, dy: number): void {
    this.change(() => {
      if (target.kind === "whole") this.state.shiftBox(dx, dy);
      else if (target.kind === "box") {
        const at = this.state.handleAt(target.handle);
        if (at) this.state.dragBox(target.handle, [at[0] + dx, at[1] + dy]);
      } else {
        const [x, y] = this.state.rings[target.ring][target.index];
        this.state.movePoint(target.ring, target.index, [x + dx, y + dy]);
      }
    });
    this.sketch.focus(target);
  }

  /** A point in the middle of the edge after this one. */
  private split(ring: number, index: number): void {
    const points = this.state.rings[ring];
    const [a, b] = [points[index], points[(index + 1) % points.length]];
    this.change(() => this.state.insertPoint(ring, index, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]));
    this.sketch.focus({ kind: "point", ring, index: index + 1 });
  }

  private closeDraft(): void {
    const { draft } = this;
    this.draft = null;
    if (draft && draft.length >= 3) this.change(() => this.state.addRing(draft));
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const delta = Math.max(-150, Math.min(150, event.deltaY * (event.deltaMode === 1 ? 33 : 1)));
    this.view.zoomBy(Math.exp(-delta * 0.003), this.inside(event));
  }

  private spaceKey(event: KeyboardEvent): void {
    if (event.code !== "Space") return;
    this.space = event.type === "keydown" && this.sketch.root.matches(":hover");
    if (this.space) event.preventDefault();
  }

  private change(make: () => void): void {
    this.state.mark();
    make();
    this.tell();
  }

  private tell(): void {
    this.draw();
    this.options.onChange(this.state.box, this.state.mask);
  }

  private draw(): void {
    const brushing = this.tool === "brush" || this.tool === "erase";
    this.sketch.draw({
      box: this.state.box,
      handles: this.tool === "box" ? BOX_HANDLES.map((name) => [name, this.state.handleAt(name)] as const) : [],
      rings: this.state.rings,
      points: this.tool === "polygon" && !this.draft,
      draft: this.draft && this.pointer ? [...this.draft, [this.pointer[0], this.pointer[1]]] : this.draft,
      stroke: this.drag?.kind === "stroke" ? this.state.mask : null,
      size: [this.state.width, this.state.height],
      brush: brushing && this.pointer ? { at: this.pointer, radius: this.brushSize * this.pixel() } : null,
      cursor: this.tool === "polygon" && !this.draft ? "default" : brushing ? "none" : "crosshair",
    });
  }

  /** Pixels of the page of one pixel of the photo. */
  private pixel(): number {
    const [a, b] = [this.view.toScreen([0, 0]), this.view.toScreen([1, 0])];
    return b[0] - a[0];
  }

  private inside(event: MouseEvent): [number, number] {
    const { left, top } = this.container.getBoundingClientRect();
    return [event.clientX - left - this.container.clientLeft, event.clientY - top - this.container.clientTop];
  }

  private photoAt(event: MouseEvent): [number, number] {
    return this.view.toPhoto(this.inside(event));
  }
}

