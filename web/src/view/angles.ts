/**
 * Azimuth, elevation and in-plane rotation to rotation matrices and back, as geometry/angles.py has them:
 * R_cv_from_s = R_cv_from_gl · Rz(inplane) · Rx(elevation - 90°) · Rz(-azimuth) · R_p_from_s.
 */
import type { Pose } from "./pose";

/** Nine numbers, row by row. */
export type Matrix3 = readonly number[];

export interface Rotation {
  azimuth: number;
  elevation: number;
  inplane: number;
}

const RADIAN = Math.PI / 180;
const R_CV_FROM_GL: Matrix3 = [1, 0, 0, 0, -1, 0, 0, 0, -1];
const R_P_FROM_S: Matrix3 = [-1, 0, 0, 0, 0, 1, 0, 1, 0];
/** Below this the view is straight from above or below, where azimuth and in-plane rotation coincide. */
const GIMBAL = 1e-9;

export function multiply(a: Matrix3, b: Matrix3): number[] {
  const out = new Array<number>(9);
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 3; column++) {
      out[3 * row + column] =
        a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column];
    }
  }
  return out;
}

export function transposed(m: Matrix3): number[] {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

/** R_cv_from_s of angles in degrees: ShapeNet axes to the OpenCV camera. */
export function rotationFromAngles(azimuth: number, elevation: number, inplane: number): number[] {
  const turned = multiply(turnX(elevation - 90), multiply(turnZ(-azimuth), R_P_FROM_S));
  return multiply(R_CV_FROM_GL, multiply(turnZ(inplane), turned));
}

/** Azimuth in [0, 360), elevation in [-90, 90], in-plane in (-180, 180]; in-plane 0 straight from above or below. */
export function anglesFromRotation(R: Matrix3): Rotation {
  // R_s_from_p and R_cv_from_gl are their own transposes.
  const G = multiply(R_CV_FROM_GL, multiply(R, R_P_FROM_S));
  const horizontal = Math.hypot(G[6], G[7]);
  const gimbal = horizontal < GIMBAL;
  const azimuth = gimbal ? Math.atan2(-G[3] * Math.sign(G[8]), G[0]) : Math.atan2(G[6], -G[7]);
  const inplane = gimbal ? 0 : Math.atan2(-G[2], G[5]);
  return {
    azimuth: wrap360(azimuth / RADIAN),
    elevation: Math.atan2(G[8], horizontal) / RADIAN,
    inplane: wrap180(inplane / RADIAN),
  };
}

/** The pose of the object turned by 180° about its own vertical: front and back swapped. */
export function flipped(pose: Pose): Pose {
  return { ...pose, azimuth: wrap360(pose.azimuth + 180) };
}

/** The pose R·S: the same look, where `S` is a symmetry of the model in ShapeNet axes. */
export function twin(pose: Pose, S: Matrix3): Pose {
  const R = rotationFromAngles(pose.azimuth, pose.elevation, pose.inplane);
  return { ...pose, ...anglesFromRotation(multiply(R, S)) };
}

/** Angle of the turn between two rotations in [0, 180]; exact near both ends. */
export function geodesicDegrees(a: Matrix3, b: Matrix3): number {
  const R = multiply(transposed(a), b);
  const axis = Math.hypot(R[7] - R[5], R[2] - R[6], R[3] - R[1]);
  return Math.atan2(axis / 2, (R[0] + R[4] + R[8] - 1) / 2) / RADIAN;
}

/** Degrees to [0, 360). */
export function wrap360(degrees: number): number {
  const wrapped = ((degrees % 360) + 360) % 360;
  return wrapped >= 360 ? 0 : wrapped;
}

/** Degrees to (-180, 180]. */
export function wrap180(degrees: number): number {
  return 180 - wrap360(180 - degrees);
}

function turnX(degrees: number): number[] {
  const c = Math.cos(degrees * RADIAN);
  const s = Math.sin(degrees * RADIAN);
  return [1, 0, 0, 0, c, -s, 0, s, c];
}

function turnZ(degrees: number): number[] {
  const c = Math.cos(degrees * RADIAN);
  const s = Math.sin(degrees * RADIAN);
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}
