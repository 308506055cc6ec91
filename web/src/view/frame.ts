/** Where the photo lies in its container: it fits, and can be enlarged and moved. Pixels are those of the page. */
import type { Point, Window } from "./camera";
import type { Box } from "./pose";

/** Free border about a photo that fits. */
const MARGIN = 12;
/** Most pixels of the page that a pixel of the photo takes. */
const LARGEST = 40;

export class Frame {
  /** Of the photo in its own pixels. */
  private photo: Point = [1, 1];
  private container: Point = [1, 1];
  /** What pixel of the photo is at the middle of the container. */
  private centre: [number, number] = [0.5, 0.5];
  private enlarged = 1;

  /** How many times larger than a photo that fits. */
  get zoom(): number {
    return this.enlarged;
  }

  /** Pixels of the page of a pixel of the photo. */
  get scale(): number {
    const [width, height] = this.photo;
    const fit = Math.min((this.container[0] - 2 * MARGIN) / width, (this.container[1] - 2 * MARGIN) / height);
    return Math.max(fit, 1e-3) * this.enlarged;
  }

  /** What part of the photo the container shows. */
  get window(): Window {
    const { scale } = this;
    const [width, height] = [this.container[0] / scale, this.container[1] / scale];
    return { x: this.centre[0] - width / 2, y: this.centre[1] - height / 2, width, height };
  }

  resize(width: number, height: number): void {
    this.container = [Math.max(width, 1), Math.max(height, 1)];
  }

  setPhoto(width: number, height: number): void {
    const same = this.photo[0] === width && this.photo[1] === height;
    this.photo = [width, height];
    if (!same) this.fit();
  }

  fit(): void {
    this.centre = [this.photo[0] / 2, this.photo[1] / 2];
    this.enlarged = 1;
  }

  /** Show a box with some photo around it. */
  focus(box: Box): void {
    this.fit();
    const [width, height] = [Math.max(box[2] - box[0], 1), Math.max(box[3] - box[1], 1)];
    const wanted = Math.min(this.container[0] / width, this.container[1] / height) / 1.5;
    this.enlarged = Math.max(1, Math.min(wanted, LARGEST) / this.scale);
    this.centre = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
    this.keepInside();
  }

  /** About a point of the container, which stays where it is. */
  zoomAt(factor: number, at: Point): void {
    const before = this.toPhoto(at);
    const most = Math.max(1, (LARGEST * this.enlarged) / this.scale);
    this.enlarged = Math.min(Math.max(this.enlarged * factor, 1), most);
    const after = this.toPhoto(at);
    this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
    this.keepInside();
  }

  pan(dx: number, dy: number): void {
    this.centre = [this.centre[0] - dx / this.scale, this.centre[1] - dy / this.scale];
    this.keepInside();
  }

  toPhoto([x, y]: Point): [number, number] {
    const { window, scale } = this;
    return [window.x + x / scale, window.y + y / scale];
  }

  toScreen([x, y]: Point): [number, number] {
    const { window, scale } = this;
    return [(x - window.x) * scale, (y - window.y) * scale];
  }

  private keepInside(): void {
    if (this.enlarged <= 1) {
      this.fit();
      return;
    }
    for (const k of [0, 1]) this.centre[k] = Math.min(Math.max(this.centre[k], 0), this.photo[k]);
  }
}
