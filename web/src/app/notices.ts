/** What the page has to say, and which dialogue is open. */

import type { Current, Decision, DecisionRequest, Detail } from "./api/types";

export type Tone = "info" | "good" | "bad";

export interface Notice {
  readonly text: string;
  readonly tone: Tone;
  readonly actions: readonly { label: string; run(): void }[];
}

export type Dialog =
  | { kind: "help" }
  | { kind: "search" }
  | { kind: "reject" }
  | { kind: "stats" }
  | { kind: "export" }
  | { kind: "upload" }
  | { kind: "replace" }
  | { kind: "author"; then: (() => void) | null }
  | { kind: "conflict"; conflict: Conflict };

export interface Conflict {
  readonly id: string;
  readonly request: DecisionRequest;
  readonly current: Current;
  /** What is stored now; null where it could not be fetched. */
  readonly theirs: Detail | null;
}

/** A decision that is not stored yet. */
export const MEANT: Record<Decision, string> = {
  accept: "Accept",
  edit: "Accept with changes",
  reject: "Reject",
  review: "Another look",
  skip: "Skip",
};

/** A decision said in the past tense. */
export const DONE: Record<Decision, string> = {
  accept: "Accepted",
  edit: "Stored with your changes",
  reject: "Rejected",
  review: "Marked for another look",
  skip: "Skipped",
};
