/** The opacity of a texture with holes, and its reductions as rendering/scene.py makes them. */
import * as THREE from "three";

export interface Level {
  data: Uint8Array<ArrayBuffer>;
  width: number;
  height: number;
}

/** From the whole picture down to one pixel, each half the side of the one before. */
export function reductions(whole: Level): Level[] {
  const levels = [whole];
  for (let last = whole; Math.max(last.width, last.height) > 1; levels.push(last)) last = halved(last);
  return levels;
}

/** Each pixel the mean of those that it covers, in part where the side is odd (OpenCV's INTER_AREA). */
function halved({ data, width, height }: Level): Level {
  const [columns, rows] = [shares(width), shares(height)];
  const out = new Uint8Array(columns.length * rows.length);
  rows.forEach((row, y) => {
    columns.forEach((column, x) => {
      let sum = 0;
      for (const [sourceY, shareY] of row) {
        for (const [sourceX, shareX] of column) sum += shareX * shareY * data[sourceY * width + sourceX];
      }
      out[y * columns.length + x] = Math.round(sum);
    });
  });
  return { data: out, width: columns.length, height: rows.length };
}

/** Of each of half as many pixels: which it covers, and with what share. */
function shares(length: number): [number, number][][] {
  const half = Math.max(1, Math.floor(length / 2));
  const step = length / half;
  return Array.from({ length: half }, (_, i) => {
    const [from, to] = [i * step, (i + 1) * step];
    const covered: [number, number][] = [];
    for (let source = Math.floor(from); source < Math.min(length, to - 1e-9); source++) {
      covered.push([source, (Math.min(source + 1, to) - Math.max(source, from)) / step]);
    }
    return covered;
  });
}

/** The opacity of a picture as a texture of one channel. */
export function holesOf(picture: ImageBitmap): THREE.Texture {
  const { width, height } = picture;
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("the browser cannot read a texture of the model");
  context.drawImage(picture, 0, 0);
  const rgba = context.getImageData(0, 0, width, height).data;
  const opacity = Uint8Array.from({ length: width * height }, (_, i) => rgba[4 * i + 3]);
  const levels = reductions({ data: opacity, width, height });
  const texture = new THREE.DataTexture(opacity, width, height, THREE.RedFormat);
  texture.mipmaps = levels;
  texture.generateMipmaps = false;
  texture.unpackAlignment = 1;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.magFilter = THREE.NearestFilter;
  texture.minFilter = THREE.NearestMipmapNearestFilter;
  texture.needsUpdate = true;
  return texture;
}
