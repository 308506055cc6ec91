/** Mouse, wheel and touch on the view: they turn, roll, move and scale the object, or zoom and pan the photo. */
import { wrap180 } from "./angles";
import type { Point } from "./camera";
import type { Pose } from "./pose";
import { moved, rolled, scaled, turned } from "./turning";

/** What gestures act on. */
export interface Held {
  pose(): Pose | null;
  change(pose: Pose, done: boolean): void;
  /** From pixels of the page's window to pixels of the photo. */
  toPhoto(client: Point): Point;
  /** In pixels of the page. */
  pan(dx: number, dy: number): void;
  zoom(factor: number, client: Point): void;
  /** Whether gestures may change the pose. */
  interactive(): boolean;
  /** Whether the pose is to be left alone for now: what would change it does nothing. */
  paused(): boolean;
  /** Radius in pixels of the photo at which an object is easy to hold. */
  leastRadius(): number;
}

type Action = "turn" | "roll" | "move" | "pan";

/** The wheel has stopped when nothing came for so long, in milliseconds. */
const WHEEL_REST = 250;

export class Gestures {
  private readonly fingers = new Map<number, Point>();
  private action: Action | null = null;
  private changed = false;
  private space = false;
  private over = false;
  private resting: ReturnType<typeof setTimeout> | null = null;
  private readonly off = new AbortController();

  constructor(
    private readonly element: HTMLElement,
    private readonly held: Held,
  ) {
    const options = { signal: this.off.signal };
    const on = <K extends keyof HTMLElementEventMap>(name: K, use: (event: HTMLElementEventMap[K]) => void): void =>
      element.addEventListener(name, use, { ...options, passive: false });
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    on("pointercancel", (event) => this.up(event));
    on("wheel", (event) => this.wheel(event));
    on("contextmenu", (event) => event.preventDefault());
    on("pointerenter", () => (this.over = true));
    on("pointerleave", () => (this.over = false));
    element.ownerDocument.addEventListener("keydown", (event) => this.key(event, true), options);
    element.ownerDocument.addEventListener("keyup", (event) => this.key(event, false), options);
    element.style.touchAction = "none";
    element.style.cursor = "grab";
  }

  /** Tell what is not told yet; who still holds the object has to take it anew. */
  finish(): void {
    if (this.resting !== null) clearTimeout(this.resting);
    this.resting = null;
    this.fingers.clear();
    this.action = null;
    this.element.style.cursor = "grab";
    const pose = this.held.pose();
    const changed = this.changed && !this.held.paused();
    this.changed = false;
    if (changed && pose) this.held.change(pose, true);
  }

  dispose(): void {
    this.off.abort();
    if (this.resting !== null) clearTimeout(this.resting);
  }

  private key(event: KeyboardEvent, pressed: boolean): void {
    if (event.code !== "Space") return;
    const typing = event.target instanceof HTMLElement && event.target.matches("input, textarea, select, button, a");
    this.space = pressed && this.over && !typing;
    // Or the page would scroll.
    if (this.space) event.preventDefault();
  }

  private down(event: PointerEvent): void {
    event.preventDefault();
    if (this.resting !== null) this.finish();
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    this.element.setPointerCapture(event.pointerId);
    this.action = this.actionOf(event);
    this.element.style.cursor = this.action === "move" || this.action === "pan" ? "move" : "grabbing";
  }

  private actionOf(event: PointerEvent): Action | null {
    if (event.button === 1 || this.space) return "pan";
    if (!this.held.interactive()) return null;
    if (event.button === 2 || event.altKey) return "move";
    return event.shiftKey ? "roll" : "turn";
  }

  private move(event: PointerEvent): void {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const now: Point = [event.clientX, event.clientY];
    if (before[0] === now[0] && before[1] === now[1]) return;
    if (this.fingers.size === 2) this.pinch(event.pointerId, before, now);
    else if (this.fingers.size === 1) this.drag(before, now);
    this.fingers.set(event.pointerId, now);
  }

  private drag(before: Point, now: Point): void {
    if (this.action === "pan") {
      this.held.pan(now[0] - before[0], now[1] - before[1]);
      return;
    }
    const pose = this.held.pose();
    if (!pose || this.action === null) return;
    const [from, to] = [this.held.toPhoto(before), this.held.toPhoto(now)];
    if (this.action === "turn") this.tell(turned(pose, from, to, this.held.leastRadius()));
    else if (this.action === "roll") this.tell(rolled(pose, from, to));
    else this.tell(moved(pose, to[0] - from[0], to[1] - from[1]));
  }

  /** Two fingers: apart is larger, around is in-plane, both along moves. */
  private pinch(id: number, before: Point, now: Point): void {
    const other = [...this.fingers].find(([key]) => key !== id)?.[1];
    const pose = this.held.pose();
    if (!other) return;
    const [ax, ay] = [before[0] - other[0], before[1] - other[1]];
    const [bx, by] = [now[0] - other[0], now[1] - other[1]];
    const factor = Math.hypot(bx, by) / Math.max(Math.hypot(ax, ay), 1);
    if (!this.held.interactive()) {
      this.held.zoom(factor, other);
      this.held.pan((now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
      return;
    }
    if (!pose || this.action === null) return;
    const [from, to] = [this.held.toPhoto(before), this.held.toPhoto(now)];
    const turn = (-(Math.atan2(by, bx) - Math.atan2(ay, ax)) * 180) / Math.PI;
    const spun = { ...pose, inplane: wrap180(pose.inplane + turn) };
    this.tell(moved(scaled(spun, factor), (to[0] - from[0]) / 2, (to[1] - from[1]) / 2));
  }

  private up(event: PointerEvent): void {
    if (!this.fingers.delete(event.pointerId)) return;
    this.element.style.cursor = "grab";
    // What is left of two fingers does not start to turn.
    this.action = null;
    if (this.fingers.size === 0) this.finish();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : 1;
    const delta = Math.max(-150, Math.min(150, (event.deltaY || event.deltaX) * lines));
    if (event.ctrlKey || event.metaKey || !this.held.interactive()) {
      this.held.zoom(Math.exp(-delta * 0.003), [event.clientX, event.clientY]);
      return;
    }
    const pose = this.held.pose();
    if (!pose) return;
    this.tell(scaled(pose, Math.exp(-delta * (event.shiftKey ? 0.00005 : 0.0004))));
    if (this.resting !== null) clearTimeout(this.resting);
    this.resting = setTimeout(() => this.finish(), WHEEL_REST);
  }

  private tell(pose: Pose): void {
    if (this.held.paused()) return;
    this.changed = true;
    this.held.change(pose, false);
  }
}
