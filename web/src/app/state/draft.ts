/** What a person has made of an annotation and not stored yet. */

import { wrap180 } from "../../view/angles";
import type { Cad, Detail, Pose, Region, Rotation } from "../api/types";

export interface Draft {
  readonly pose: Pose;
  readonly cad: Cad;
  /** Null while box and mask are the detection's. */
  readonly region: Region | null;
}

export interface Changes {
  pose: Pose | null;
  cad_id: string | null;
  region: Region | null;
}

export function draftOf(detail: Detail): Draft {
  return { pose: detail.pose, cad: detail.cad, region: null };
}

export function detectedOf(detail: Detail): Region {
  return { box: detail.detection.box, mask: detail.detection.mask };
}

// Below these a change is rounding, not somebody's will.
const DEGREES = 1e-3;
const PIXELS = 1e-3;
const RATIO = 1e-6;

export function samePose(a: Pose, b: Pose): boolean {
  return (
    sameRotation(a, b) &&
    Math.abs(a.focal_px / b.focal_px - 1) < RATIO &&
    Math.abs(a.t_z / b.t_z - 1) < RATIO &&
    Math.abs(a.principal_px[0] - b.principal_px[0]) < PIXELS &&
    Math.abs(a.principal_px[1] - b.principal_px[1]) < PIXELS
  );
}

export function sameRotation(a: Rotation, b: Rotation): boolean {
  return (
    Math.abs(turn(a.azimuth, b.azimuth)) < DEGREES &&
    Math.abs(a.elevation - b.elevation) < DEGREES &&
    Math.abs(turn(a.inplane, b.inplane)) < DEGREES
  );
}

/** From one angle to another the short way, in degrees. */
export function turn(from: number, to: number): number {
  return -wrap180(from - to);
}

export function changesOf(base: Draft, draft: Draft): Changes {
  return {
    pose: samePose(base.pose, draft.pose) ? null : draft.pose,
    cad_id: base.cad.id === draft.cad.id ? null : draft.cad.id,
    region: draft.region,
  };
}

/** What has to be sent so that a draft on top of that detection holds instead of what is stored now. */
export function changesOnTop(stored: Detail, draft: Draft, detected: Region): Changes {
  const wanted = draft.region ?? detected;
  const region = sameRegion(detectedOf(stored), wanted) ? null : wanted;
  return { ...changesOf(draftOf(stored), draft), region };
}

function sameRegion(a: Region, b: Region): boolean {
  const boxes = a.box.every((value, place) => Math.abs(value - (b.box[place] ?? Number.NaN)) < PIXELS);
  return boxes && a.mask?.counts === b.mask?.counts && String(a.mask?.size) === String(b.mask?.size);
}

export function isChanged(base: Draft, draft: Draft): boolean {
  const changes = changesOf(base, draft);
  return changes.pose !== null || changes.cad_id !== null || changes.region !== null;
}

/** What differs, in words: "azimuth +12.0°, focal length -4.1 %". */
export function describe(before: Draft, after: Draft): string[] {
  const told: string[] = [];
  const a = before.pose;
  const b = after.pose;
  if (before.cad.id !== after.cad.id) told.push(`model ${after.cad.name}`);
  tell(told, "azimuth", turn(a.azimuth, b.azimuth), "°");
  tell(told, "elevation", b.elevation - a.elevation, "°");
  tell(told, "in-plane", turn(a.inplane, b.inplane), "°");
  tell(told, "focal length", (b.focal_px / a.focal_px - 1) * 100, " %");
  const shift = Math.hypot(b.principal_px[0] - a.principal_px[0], b.principal_px[1] - a.principal_px[1]);
  if (shift >= 0.05) told.push(`moved ${shift.toFixed(1)} px`);
  if (after.region !== before.region) told.push("box and mask");
  return told;
}

function tell(told: string[], what: string, change: number, unit: string): void {
  if (Math.abs(change) < 0.05) return;
  told.push(`${what} ${change > 0 ? "+" : "−"}${Math.abs(change).toFixed(1)}${unit}`);
}
