/** The numbers of a pose as fields: their ranges, steps, and the slider's scale. */

import { wrap180, wrap360 } from "../../view/angles";
import type { Pose } from "../api/types";

export type FieldName = "azimuth" | "elevation" | "inplane" | "focal_px" | "principal_x" | "principal_y";

export interface Field {
  readonly name: FieldName;
  readonly label: string;
  readonly unit: string;
  readonly digits: number;
  readonly step: number;
  readonly logarithmic: boolean;
  range(width: number, height: number): [number, number];
}

const fixed =
  (low: number, high: number) =>
  (): [number, number] => [low, high];

export const FIELDS: readonly Field[] = [
  { name: "azimuth", label: "Azimuth", unit: "°", digits: 1, step: 1, logarithmic: false, range: fixed(0, 360) },
  { name: "elevation", label: "Elevation", unit: "°", digits: 1, step: 1, logarithmic: false, range: fixed(-90, 90) },
  {
    name: "inplane",
    label: "In-plane rotation",
    unit: "°",
    digits: 1,
    step: 1,
    logarithmic: false,
    range: fixed(-180, 180),
  },
  {
    name: "focal_px",
    label: "Focal length",
    unit: "px",
    digits: 0,
    step: 1,
    logarithmic: true,
    range: (width, height) => [0.1 * Math.max(width, height), 20 * Math.max(width, height)],
  },
];

export const MORE_FIELDS: readonly Field[] = [
  {
    name: "principal_x",
    label: "Offset right",
    unit: "px",
    digits: 1,
    step: 1,
    logarithmic: false,
    range: (width) => [-0.5 * width, 1.5 * width],
  },
  {
    name: "principal_y",
    label: "Offset down",
    unit: "px",
    digits: 1,
    step: 1,
    logarithmic: false,
    range: (_width, height) => [-0.5 * height, 1.5 * height],
  },
];

export function valueOf(pose: Pose, name: FieldName): number {
  if (name === "principal_x") return pose.principal_px[0];
  if (name === "principal_y") return pose.principal_px[1];
  return pose[name];
}

/** The pose with one number changed, brought back into its range; null where it is no number. */
export function withValue(pose: Pose, name: FieldName, value: number): Pose | null {
  if (!Number.isFinite(value)) return null;
  switch (name) {
    case "azimuth":
      return { ...pose, azimuth: wrap360(value) };
    case "elevation":
      return { ...pose, elevation: Math.min(90, Math.max(-90, value)) };
    case "inplane":
      return { ...pose, inplane: wrap180(value) };
    case "focal_px":
      return value > 0 ? { ...pose, focal_px: value } : null;
    case "principal_x":
      return { ...pose, principal_px: [value, pose.principal_px[1]] };
    case "principal_y":
      return { ...pose, principal_px: [pose.principal_px[0], value] };
  }
}

/** A value's place on a slider of 0 to 1000. */
export function toSlider(value: number, low: number, high: number, logarithmic: boolean): number {
  const share = logarithmic
    ? Math.log(value / low) / Math.log(high / low)
    : (value - low) / (high - low);
  return Math.min(1000, Math.max(0, share * 1000));
}

export function fromSlider(place: number, low: number, high: number, logarithmic: boolean): number {
  const share = place / 1000;
  return logarithmic ? low * Math.exp(share * Math.log(high / low)) : low + share * (high - low);
}
