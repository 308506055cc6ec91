/** One object of the queue in two lines. */

import type { Item } from "../api/types";
import { verdictLabel } from "../state/filters";
import { Icon } from "../ui/icon";
import { Thumb } from "../ui/thumb";

export function QueueRow({ item, dirty }: { item: Item | undefined; dirty: boolean }) {
  if (!item) {
    return (
      <span class="queue-row waiting">
        <span class="thumb none" />
        <span class="row-text">…</span>
      </span>
    );
  }
  return (
    <span class="queue-row" data-annotation={item.id}>
      <Thumb url={item.thumb} size={48} instead={item.category} />
      <span class="row-text">
        <span class="row-head">
          <b>{item.category}</b>
          {dirty && (
            <span class="draft-dot" title="Changed, not stored">
              <span class="hidden">changed, not stored</span>
            </span>
          )}
          <span class="row-confidence" title="Chance that the machine's answer is right">
            {item.confidence === null ? "–" : `${Math.round(item.confidence * 100)} %`}
          </span>
        </span>
        <span class="row-name" title={`${item.photo.name}: ${item.cad.name}`}>
          {item.photo.name.split("/").at(-1)}
        </span>
        <VerdictBadge item={item} />
      </span>
    </span>
  );
}

export function VerdictBadge({ item }: { item: Pick<Item, "verdict" | "decided_by"> }) {
  const verdict = item.verdict ?? "undecided";
  const human = item.decided_by === "human";
  const label = verdictLabel(item.verdict, human);
  return (
    <span class={`badge ${human ? verdict : `by-program ${verdict}`}`}>
      {human && <Icon name="person" />}
      {label}
      {human && <span class="hidden">, by a person</span>}
    </span>
  );
}
