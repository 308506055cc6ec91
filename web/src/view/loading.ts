/**
 * Photos and models, kept for the next time they are shown, by all views of a page. What is dropped leaves the
 * graphics card; a view that still shows it brings it back.
 */
import * as THREE from "three";

import { Cache } from "./cache";
import { Model } from "./model";

const PHOTOS = 12;
const MODELS = 16;

export const photos = new Cache(PHOTOS, loadPhoto, (texture) => texture.dispose());
export const models = new Cache(MODELS, loadModel, (model) => model.dispose());

async function loadPhoto(url: string): Promise<THREE.Texture> {
  // An element and not fetch: the page's policy lets it show blob: and data: addresses too.
  const element = new Image();
  element.src = url;
  try {
    await element.decode();
  } catch {
    throw new Error("the photo could not be loaded");
  }
  const texture = new THREE.Texture(await createImageBitmap(element));
  texture.flipY = false;
  texture.colorSpace = THREE.NoColorSpace;
  texture.minFilter = THREE.LinearMipmapLinearFilter;
  texture.generateMipmaps = true;
  texture.needsUpdate = true;
  return texture;
}

async function loadModel(url: string): Promise<Model> {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`the model could not be loaded (${answer.status})`);
  return Model.from(await answer.arrayBuffer());
}

/** A mask on the graphics card. */
export function maskTexture(mask: Uint8Array, width: number, height: number): THREE.Texture {
  const bytes = mask.map((value) => (value ? 255 : 0));
  const texture = new THREE.DataTexture(bytes, width, height, THREE.RedFormat);
  texture.unpackAlignment = 1;
  texture.magFilter = texture.minFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
