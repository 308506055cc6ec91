/** Three angles in degrees, focal length and principal point in pixels of the photo, distance in model diagonals. */
export interface Pose {
  azimuth: number;
  elevation: number;
  inplane: number;
  focal_px: number;
  /** Where the model's origin is projected, continuous pixels of the photo. */
  principal_px: [number, number];
  t_z: number;
}

export type Display = "blend" | "outline" | "wireframe" | "mask" | "difference" | "photo";
export const DISPLAYS: readonly Display[] = ["blend", "outline", "wireframe", "mask", "difference", "photo"];

/** x0, y0, x1, y1 in continuous pixels of the photo. */
export type Box = [number, number, number, number];
