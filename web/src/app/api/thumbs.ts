/** Addresses of the library's thumbnails: rounded as the server rounds, so that a turn asks for few of them. */

import type { Rotation } from "./types";

const STEP = 5;

export function thumbUrl(key: string, rotation: Rotation, size = 96): string {
  const azimuth = modulo(round(rotation.azimuth), 360);
  const elevation = round(rotation.elevation);
  const inplane = round(rotation.inplane);
  return (
    `/api/cads/${encodeURIComponent(key)}/thumb.png` +
    `?azimuth=${azimuth}&elevation=${elevation}&inplane=${inplane}&size=${size}`
  );
}

export function meshUrl(key: string): string {
  return `/api/cads/${encodeURIComponent(key)}/mesh.glb`;
}

function round(degrees: number): number {
  // Adding 0 makes -0 a 0.
  return Math.round(degrees / STEP) * STEP + 0;
}

function modulo(value: number, by: number): number {
  return ((value % by) + by) % by;
}
