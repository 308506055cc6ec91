/** What the server says and takes; the units are degrees and pixels of the whole photo. */

export interface Rotation {
  azimuth: number;
  elevation: number;
  inplane: number;
}

export interface Pose extends Rotation {
  focal_px: number;
  principal_px: [number, number];
  t_z: number;
}

export interface Rle {
  size: [number, number];
  counts: string;
}

export type Box = [number, number, number, number];

export interface Region {
  box: Box;
  mask: Rle | null;
}

export interface Cad {
  id: string;
  key: string;
  name: string;
  category: string;
  licence: string;
  creator: string;
  source: string;
  size_cm: [number, number, number] | null;
  available: boolean;
}

export interface Format {
  name: string;
  title: string;
  /** Empty, or why this format cannot be made here. */
  needs: string;
}

export interface Session {
  version: string;
  author: string;
  store: string;
  library: { models: number; categories: Record<string, number> } | null;
  limits: { upload_bytes: number; pixels: number };
  actions: { annotate: boolean; snap: boolean; replace: boolean; example: boolean };
  formats: Format[];
  reasons: string[];
}

export interface PhotoName {
  sha256: string;
  name: string;
  width: number;
  height: number;
}

/** What a person or the program can have said; null where nobody has. */
export type Verdict = "accept" | "reject" | "edit" | "auto_accept" | "review" | "skip";
export type DecidedBy = "human" | "program" | null;
/** What the page sends. */
export type Decision = "accept" | "reject" | "edit" | "review" | "skip";

export interface Item {
  id: string;
  version: number;
  photo: PhotoName;
  category: string;
  cad: { id: string; name: string };
  box_iou: number | null;
  mask_iou: number | null;
  confidence: number | null;
  machine_verdict: string | null;
  verdict: Verdict | null;
  decided_by: DecidedBy;
  edited: boolean;
  thumb: string;
}

export interface ItemPage {
  items: Item[];
  after: string | null;
  total: number;
}

export interface Candidate {
  rank: number;
  cad: Cad;
  score: number | null;
  probability: number | null;
  rotation: Rotation | null;
}

export interface Hypothesis {
  rotation: Rotation;
  score: number | null;
  probability: number | null;
  expected_error: number | null;
  needs_review: boolean | null;
}

export interface Happening {
  author: string;
  kind: "human" | "program";
  at: string;
  verdict: Verdict;
  reason: string;
  note: string;
  changed: string[];
}

export interface Detail {
  id: string;
  version: number;
  in_force: boolean;
  photo: PhotoName & { image: string | null };
  detection: {
    category: string;
    score: number;
    box: Box;
    mask: Rle | null;
    source: string;
    truncated: boolean;
    tiny: boolean;
    unsure: boolean;
    alternatives: [string, number][];
  };
  pose: Pose;
  cad: Cad;
  machine: { pose: Pose; cad: Cad };
  start: Pose | null;
  candidates: Candidate[];
  hypotheses: Hypothesis[];
  none_probability: number | null;
  confidence: number | null;
  machine_verdict: string | null;
  verdict: Verdict | null;
  decided_by: DecidedBy;
  edited: boolean;
  box_iou: number | null;
  mask_iou: number | null;
  depth: unknown;
  history: Happening[];
  siblings: string[];
}

export interface DecisionRequest {
  verdict: Decision;
  version: number;
  author: string;
  reason: string;
  note: string;
  pose: Pose | null;
  cad_id: string | null;
  region: Region | null;
  /** 32 hex digits: who sends the same once more gets the first answer again. */
  request_id: string;
}

/** How an object stands on the page; null is what is stored. */
export interface Standing {
  pose: Pose | null;
  cad_id: string | null;
  region: Region | null;
}

export interface Snapped {
  pose: Pose;
  box_iou: number | null;
  mask_iou: number | null;
  start_score: number | null;
  score: number | null;
  seconds: number;
}

export interface Symmetry {
  name: string;
  R: number[][];
  continuous: boolean;
}

export interface Job {
  id: string;
  name: string;
  state: "queued" | "running" | "done" | "failed";
  stage: string;
  share: number;
  error: string | null;
  photo_sha256: string | null;
  annotations: string[];
  seconds: number | null;
}

export interface Replaced {
  picture: string;
  scene: string;
  seconds: number;
}

export interface Progress {
  total: number;
  /** Objects on which a person has decided. */
  decided: number;
}

export interface Stats {
  total: number;
  decided: number;
  by_verdict: Record<string, number>;
  authors: { author: string; decisions: number; last_hour: number; median_seconds: number | null }[];
  days: { day: string; decisions: number }[];
  agreement: {
    between_people: { pairs: number; same_verdict: number | null; median_rotation_deg: number | null };
    with_machine: { decided: number; accepted_unchanged: number; edited: number; rejected: number };
  };
}

/** What holds now, told with a 409. */
export interface Current {
  version: number;
  /** False where another answer took this one's place: the photo was annotated anew. */
  in_force: boolean;
  verdict: Verdict | null;
  by: string | null;
}

export type ErrorKind =
  | "conflict"
  | "not_found"
  | "bad_input"
  | "too_large"
  | "busy"
  | "forbidden"
  | "failed"
  | "network";
