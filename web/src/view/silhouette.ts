/** The model's silhouette in the photo's own pixels, as the rasteriser makes it: half of 2 x 2 samples covered. */
import * as THREE from "three";

import { projectedBox, type Window } from "./camera";
import type { Model } from "./model";
import { Pass } from "./pass";
import type { Pose } from "./pose";

/** Samples a pixel along each axis: rendering/raster.py's default. */
const SAMPLES = 2;
/** Longest side in pixels that is drawn at once. */
const TILE = 1024;
/**
 * Graphics cards snap corners to a part of a sample, some to no less than 1/16. Where there is room, and where that
 * part is coarse, samples are drawn as the middles of finer ones, this many times along each axis; odd numbers.
 */
const FINEST = 9;
const FINE = 5;
const ENOUGH_BITS = 8;

/** Four pixels of a row in one texel; rows from the top. */
const REDUCE = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D samples;
uniform int rows;
uniform int finer; // odd
out vec4 result;

float covered(ivec2 pixel) {
  ivec2 at = 2 * finer * ivec2(pixel.x, rows - 1 - pixel.y) + finer / 2;
  float sum = texelFetch(samples, at, 0).a + texelFetch(samples, at + ivec2(finer, 0), 0).a;
  sum += texelFetch(samples, at + ivec2(0, finer), 0).a + texelFetch(samples, at + ivec2(finer, finer), 0).a;
  return sum > 1.5 ? 1.0 / 255.0 : 0.0;
}

void main() {
  ivec2 first = ivec2(gl_FragCoord.xy) * ivec2(4, 1);
  result = vec4(
    covered(first), covered(first + ivec2(1, 0)), covered(first + ivec2(2, 0)), covered(first + ivec2(3, 0))
  );
}
`;

export interface Grid {
  /** Of the grid's pixels; `step` pixels of the photo are one of them. */
  x: number;
  y: number;
  width: number;
  height: number;
  step: number;
}

export class Silhouettes {
  private readonly samples = new THREE.WebGLRenderTarget(SAMPLES * TILE, SAMPLES * TILE, {
    minFilter: THREE.NearestFilter,
    magFilter: THREE.NearestFilter,
    stencilBuffer: true,
  });
  private readonly reduced = new THREE.WebGLRenderTarget(TILE / 4, TILE, {
    minFilter: THREE.NearestFilter,
    magFilter: THREE.NearestFilter,
    depthBuffer: false,
  });
  private readonly reduce = new Pass(REDUCE, { samples: this.samples.texture, rows: TILE, finer: 1 });

  /** How fine the samples of a whole silhouette are at least. */
  private readonly least: number;

  constructor(private readonly renderer: THREE.WebGLRenderer) {
    const gl = renderer.getContext();
    this.samples.scissorTest = true;
    this.least = gl.getParameter(gl.SUBPIXEL_BITS) >= ENOUGH_BITS ? 1 : FINE;
  }

  /** 0 or 1 for each pixel of the photo, row by row. */
  whole(model: Model, pose: Pose, width: number, height: number): Uint8Array {
    const out = new Uint8Array(width * height);
    const grid = this.grid(model, pose, width, height, Infinity);
    this.each(model, pose, grid, this.least, (data, stride, tile) => {
      for (let row = 0; row < tile.height; row++) {
        out.set(data.subarray(row * stride, row * stride + tile.width), (tile.y + row) * width + tile.x);
      }
    });
    return out;
  }

  /** How many pixels the silhouette and the mask share, and how many the silhouette has, of about `most` at most. */
  overlap(
    model: Model, pose: Pose, mask: Uint8Array, width: number, height: number, most: number,
  ): { both: number; drawn: number } {
    const grid = this.grid(model, pose, width, height, most);
    const half = grid.step >> 1;
    let both = 0;
    let drawn = 0;
    this.each(model, pose, grid, 1, (data, stride, tile) => {
      for (let row = 0; row < tile.height; row++) {
        const start = Math.min((tile.y + row) * grid.step + half, height - 1) * width;
        for (let column = 0; column < tile.width; column++) {
          if (!data[row * stride + column]) continue;
          drawn++;
          both += mask[start + Math.min((tile.x + column) * grid.step + half, width - 1)];
        }
      }
    });
    return { both: both * grid.step ** 2, drawn: drawn * grid.step ** 2 };
  }

  dispose(): void {
    this.samples.dispose();
    this.reduced.dispose();
    this.reduce.dispose();
  }

  /** The pixels of the photo that the model may cover, coarser where they are more than `most`. */
  private grid(model: Model, pose: Pose, width: number, height: number, most: number): Grid {
    const box = projectedBox(pose, model.bounds) ?? [0, 0, width, height];
    const at = (value: number, limit: number): number => Math.min(Math.max(value, 0), limit);
    const [x0, y0] = [at(Math.floor(box[0]) - 1, width), at(Math.floor(box[1]) - 1, height)];
    const [x1, y1] = [at(Math.ceil(box[2]) + 1, width), at(Math.ceil(box[3]) + 1, height)];
    const step = Math.max(1, Math.ceil(Math.sqrt(((x1 - x0) * (y1 - y0)) / most)));
    const [x, y] = [Math.floor(x0 / step), Math.floor(y0 / step)];
    return { x, y, width: Math.ceil(x1 / step) - x, height: Math.ceil(y1 / step) - y, step };
  }

  /** Draw the grid tile by tile, samples at least that fine; rows of a tile lie `stride` apart. */
  private each(
    model: Model, pose: Pose, grid: Grid, least: number, use: (data: Uint8Array, stride: number, tile: Grid) => void,
  ): void {
    const { renderer } = this;
    const side = 4 * Math.floor(TILE / least / 4);
    for (let y = 0; y < grid.height; y += side) {
      for (let x = 0; x < grid.width; x += side) {
        const width = Math.min(side, grid.width - x);
        const height = Math.min(side, grid.height - y);
        const tile = { x: grid.x + x, y: grid.y + y, width, height, step: grid.step };
        const stride = 4 * Math.ceil(width / 4);
        const room = Math.floor(TILE / Math.max(stride, height));
        const finer = Math.min(FINEST, room - 1 + (room % 2));
        this.samples.viewport.set(0, 0, SAMPLES * finer * stride, SAMPLES * finer * height);
        this.samples.scissor.copy(this.samples.viewport);
        renderer.setRenderTarget(this.samples);
        renderer.setClearColor(0, 0);
        renderer.clear();
        const window: Window = {
          x: tile.x * grid.step,
          y: tile.y * grid.step,
          width: stride * grid.step,
          height: height * grid.step,
        };
        model.aim(pose, window);
        model.draw(renderer, "white", finer);
        this.reduced.viewport.set(0, 0, stride / 4, height);
        this.reduce.set({ rows: height, finer });
        this.reduce.draw(renderer, this.reduced);
        const data = new Uint8Array(stride * height);
        renderer.readRenderTargetPixels(this.reduced, 0, 0, stride / 4, height, data);
        use(data, stride, tile);
      }
    }
    renderer.setRenderTarget(null);
  }
}
