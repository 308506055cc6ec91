/** What dragging makes of a pose: the object is held like a ball, its middle at the principal point. */
import { wrap180, wrap360 } from "./angles";
import type { Point } from "./camera";
import type { Pose } from "./pose";

const RADIAN = Math.PI / 180;
/** Where a drag hardly moves the held point, it turns little instead of a lot. */
const DAMPING = 0.3;
/** Outside of this part of the ball its surface counts as no steeper: a drag there still turns. */
const STEEPEST = 0.5;

/** Radius of the ball in pixels of the photo: the sphere about the unit diagonal. */
export function ballRadius(pose: Pose): number {
  return (0.5 * pose.focal_px) / pose.t_z;
}

/**
 * The pose after the held point went from one pixel to another, in steps so small that it follows the cursor.
 *
 * Only azimuth and elevation change; elevation stops straight above and below. Seen from above, the far half of
 * the object follows the cursor as well, so it turns the other way than the near half.
 *
 * @param least The least radius of the ball in pixels: a small object is not hard to hold.
 */
export function turned(pose: Pose, from: Point, to: Point, least = 0): Pose {
  const radius = Math.max(ballRadius(pose), least);
  const steps = Math.max(1, Math.ceil(Math.hypot(to[0] - from[0], to[1] - from[1]) / (0.05 * radius)));
  const c = Math.cos(pose.inplane * RADIAN);
  const s = Math.sin(pose.inplane * RADIAN);
  // Into axes that turn with the object's vertical, y up, in radii.
  const along = ([x, y]: Point): [number, number] => [
    (c * (x - pose.principal_px[0]) - s * (y - pose.principal_px[1])) / radius,
    (-s * (x - pose.principal_px[0]) - c * (y - pose.principal_px[1])) / radius,
  ];
  const [x0, y0] = along(from);
  const [x1, y1] = along(to);
  let { azimuth, elevation } = pose;
  for (let step = 0; step < steps; step++) {
    const share = (step + 0.5) / steps;
    const x = x0 + share * (x1 - x0);
    const y = y0 + share * (y1 - y0);
    const height = Math.sqrt(Math.max(1 - x * x - y * y, STEEPEST * STEEPEST));
    // How far the held point goes right a radian of azimuth.
    const gain = Math.cos(elevation * RADIAN) * height - Math.sin(elevation * RADIAN) * Math.max(-1, Math.min(1, y));
    azimuth -= ((x1 - x0) / steps) * (gain / (gain * gain + DAMPING * DAMPING)) / RADIAN;
    elevation -= (y1 - y0) / steps / height / RADIAN;
    elevation = Math.max(-90, Math.min(90, elevation));
  }
  return { ...pose, azimuth: wrap360(azimuth), elevation };
}

/** The pose after the image was turned about the principal point, the cursor going from one pixel to another. */
export function rolled(pose: Pose, from: Point, to: Point): Pose {
  const [x, y] = pose.principal_px;
  // Close to the middle a small step would be a large turn.
  const least = 0.15 * ballRadius(pose);
  const angle = (p: Point): number => Math.atan2(-(p[1] - y), p[0] - x);
  if (Math.min(Math.hypot(from[0] - x, from[1] - y), Math.hypot(to[0] - x, to[1] - y)) < least) return pose;
  return { ...pose, inplane: wrap180(pose.inplane + wrap180((angle(to) - angle(from)) / RADIAN)) };
}

export function moved(pose: Pose, dx: number, dy: number): Pose {
  return { ...pose, principal_px: [pose.principal_px[0] + dx, pose.principal_px[1] + dy] };
}

/** Larger or smaller about the principal point. */
export function scaled(pose: Pose, factor: number): Pose {
  return { ...pose, focal_px: Math.min(Math.max(pose.focal_px * factor, 1), 1e6) };
}
