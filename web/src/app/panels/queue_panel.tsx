/** The queue, most doubtful first, with its filters. */

import { useState } from "preact/hooks";

import { useApp } from "../app_state";
import { isNarrowed, NO_FILTERS } from "../state/filters";
import { Icon } from "../ui/icon";
import { VirtualList } from "../ui/virtual_list";
import { FilterBar } from "./filter_bar";
import { QueueRow } from "./queue_row";

const ROW = 68;

export function QueuePanel() {
  const app = useApp();
  const { review } = app;
  const { queue } = review;
  const [open, setOpen] = useState(false);
  const filters = queue.filters.value;
  const narrowed = isNarrowed(filters);
  const total = queue.total;

  return (
    <nav class="queue" aria-label="Queue">
      <div class="queue-head">
        <h2>
          Queue <span class="count">{queue.loaded ? total.toLocaleString("en") : "…"}</span>
        </h2>
        <button
          type="button"
          class={narrowed ? "command on" : "command"}
          aria-expanded={open}
          aria-controls="filters"
          onClick={() => setOpen(!open)}
        >
          <Icon name="filter" />
          <span>{narrowed ? "Filtered" : "Filter"}</span>
        </button>
      </div>
      <div id="filters" hidden={!open}>
        <FilterBar />
      </div>
      {queue.error.value && (
        <p class="problem" role="alert">
          {queue.error.value}{" "}
          <button type="button" onClick={() => void (queue.loaded ? queue.ensure(total) : queue.reload())}>
            Try again
          </button>
        </p>
      )}
      {queue.loaded && total === 0 && narrowed && (
        <p class="hint">
          Nothing here fits the filter.{" "}
          <button type="button" onClick={() => void queue.narrow(NO_FILTERS)}>
            Show all
          </button>
        </p>
      )}
      <VirtualList
        label="Objects, most doubtful first"
        total={total}
        row={ROW}
        selected={queue.indexOf(review.currentId.value)}
        onReach={(end) => void queue.ensure(end)}
        onChoose={(place) => {
          const item = queue.at(place);
          if (!item) return;
          if (review.tab.peek() === "queue") review.tab.value = "adjust";
          void review.open(item.id);
          review.focusView();
        }}
        onReady={(focus) => {
          app.focusQueue = focus;
        }}
      >
        {(place) => {
          const item = queue.at(place);
          return <QueueRow item={item} dirty={item !== undefined && review.isDirty(item.id)} />;
        }}
      </VirtualList>
    </nav>
  );
}
