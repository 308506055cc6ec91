import { expect, test } from "vitest";

import { ApiError } from "./api/client";
import { itemOf } from "./fake";
import { Queue } from "./queue";

/** A queue whose server gives two items at a time. */
function inPairs(count: number, broken = Number.POSITIVE_INFINITY): Queue {
  const items = Array.from({ length: count }, (_, place) => itemOf(`item-${place}`));
  return new Queue({
    queue: async ({ after }) => {
      await new Promise((resolve) => setTimeout(resolve, 1));
      const from = typeof after === "string" ? Number(after) : 0;
      if (from >= broken) throw new ApiError("The server does not answer.", "network", 0);
      const next = from + 2 < count ? String(from + 2) : null;
      return { items: items.slice(from, from + 2), after: next, total: count };
    },
  });
}

test("the next item is waited for where its page is not there yet", async () => {
  const queue = inPairs(9);
  await queue.reload();
  for (let place = 0; place < 8; place++) {
    expect((await queue.neighbour(`item-${place}`, 1))?.id).toBe(`item-${place + 1}`);
  }
  expect(await queue.neighbour("item-8", 1)).toBeUndefined();
  expect((await queue.neighbour("item-8", -1))?.id).toBe("item-7");
  expect(await queue.neighbour("item-0", -1)).toBeUndefined();
});

test("a page that does not come is an error and no end", async () => {
  const queue = inPairs(9, 2);
  await queue.reload();
  expect(await queue.neighbour("item-1", 1)).toBeUndefined();
  expect(queue.error.value).toBe("The server does not answer.");
});
