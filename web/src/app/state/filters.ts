/** What the queue is narrowed to. */

import type { Item } from "../api/types";

export interface Filters {
  readonly verdicts: readonly string[];
  readonly category: string;
  readonly text: string;
  readonly decidedBy: "" | "human" | "program";
  /** Confidence, in [0, 1]; 0 and 1 are no bounds. */
  readonly least: number;
  readonly most: number;
}

export const NO_FILTERS: Filters = { verdicts: [], category: "", text: "", decidedBy: "", least: 0, most: 1 };

/** In the order in which they are shown; "undecided" is the store's word for none. */
export const VERDICTS: readonly { value: string; label: string }[] = [
  { value: "undecided", label: "Undecided" },
  { value: "review", label: "To review" },
  { value: "auto_accept", label: "Auto-accepted" },
  { value: "accept", label: "Accepted" },
  { value: "edit", label: "Corrected" },
  { value: "reject", label: "Rejected" },
];

export function verdictLabel(verdict: string | null, human = true): string {
  // The program's "reject" is advice: nobody has rejected anything yet.
  if (verdict === "reject" && !human) return "Doubtful";
  if (verdict === "skip") return "Skipped";
  return VERDICTS.find((each) => each.value === (verdict ?? "undecided"))?.label ?? String(verdict);
}

export function isNarrowed(filters: Filters): boolean {
  return (
    filters.verdicts.length > 0 ||
    filters.category !== "" ||
    filters.text.trim() !== "" ||
    filters.decidedBy !== "" ||
    filters.least > 0 ||
    filters.most < 1
  );
}

export function filterQuery(filters: Filters): Record<string, string | number | readonly string[] | null> {
  return {
    verdict: filters.verdicts,
    category: filters.category,
    text: filters.text.trim(),
    decided_by: filters.decidedBy,
    min_confidence: filters.least > 0 ? filters.least : null,
    max_confidence: filters.most < 1 ? filters.most : null,
  };
}

export function toggled(verdicts: readonly string[], verdict: string): string[] {
  return verdicts.includes(verdict) ? verdicts.filter((each) => each !== verdict) : [...verdicts, verdict];
}

export function categoriesOf(items: Iterable<Item>): string[] {
  return [...new Set([...items].map((item) => item.category))].sort();
}
