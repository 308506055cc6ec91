/**
 * The pinhole camera of a pose as matrices of OpenGL. Pixels are continuous: pixel (c, r) covers
 * [c, c+1) x [r, r+1), as in geometry/camera.py.
 */
import { rotationFromAngles } from "./angles";
import type { Pose } from "./pose";

/** Nearest distance that is drawn, in model diagonals, as in rendering/visibility.py. */
export const NEAR = 0.01;

export type Point = readonly [number, number];
/** Lowest and highest corner: x0, y0, z0, x1, y1, z1. */
export type Bounds = readonly number[];

/** A rectangle of the photo, in its pixels, that fills a picture. */
export interface Window {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Sixteen numbers, column by column, as three and WebGL want them. */
export type Matrix4 = number[];

/** Model to camera (x right, y up, z backward). */
export function modelView(pose: Pose): Matrix4 {
  const R = rotationFromAngles(pose.azimuth, pose.elevation, pose.inplane);
  return [R[0], -R[3], -R[6], 0, R[1], -R[4], -R[7], 0, R[2], -R[5], -R[8], 0, 0, 0, -pose.t_z, 1];
}

/** Camera to clip space, for the part of the photo in `window`. */
export function projection(pose: Pose, window: Window, near: number, far: number): Matrix4 {
  const f = pose.focal_px;
  const [x, y] = pose.principal_px;
  return [
    (2 * f) / window.width, 0, 0, 0,
    0, (2 * f) / window.height, 0, 0,
    1 - (2 * (x - window.x)) / window.width, (2 * (y - window.y)) / window.height - 1,
    (far + near) / (near - far), -1,
    0, 0, (2 * far * near) / (near - far), 0,
  ]; // prettier-ignore
}

/** Near and far planes close about the model: depth has few bits. */
export function depthRange(pose: Pose, bounds: Bounds): [number, number] {
  const depths = corners(bounds).map((corner) => cameraPoint(pose, corner)[2]);
  const near = Math.max(NEAR, 0.999 * Math.min(...depths));
  return [near, Math.max(1.001 * Math.max(...depths), near + 1e-3)];
}

/** Photo pixel of a point of the model; null at or behind the camera. */
export function project(pose: Pose, point: readonly number[]): [number, number] | null {
  const [x, y, z] = cameraPoint(pose, point);
  if (z <= 0) return null;
  return [(pose.focal_px * x) / z + pose.principal_px[0], (pose.focal_px * y) / z + pose.principal_px[1]];
}

/** Rectangle x0, y0, x1, y1 of the photo that holds the projected model; null where it reaches behind the camera. */
export function projectedBox(pose: Pose, bounds: Bounds): [number, number, number, number] | null {
  const box: [number, number, number, number] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const corner of corners(bounds)) {
    if (cameraPoint(pose, corner)[2] < NEAR) return null;
    const [x, y] = project(pose, corner) as [number, number];
    box[0] = Math.min(box[0], x);
    box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x);
    box[3] = Math.max(box[3], y);
  }
  return box;
}

function cameraPoint(pose: Pose, [x, y, z]: readonly number[]): [number, number, number] {
  const R = rotationFromAngles(pose.azimuth, pose.elevation, pose.inplane);
  return [
    R[0] * x + R[1] * y + R[2] * z,
    R[3] * x + R[4] * y + R[5] * z,
    R[6] * x + R[7] * y + R[8] * z + pose.t_z,
  ];
}

function corners(bounds: Bounds): number[][] {
  const out: number[][] = [];
  for (let i = 0; i < 8; i++) out.push([bounds[i & 1 ? 3 : 0], bounds[i & 2 ? 4 : 1], bounds[i & 4 ? 5 : 2]]);
  return out;
}
