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
