import { expect, test } from "vitest";

import type { ItemPage } from "../api/types";
import { itemOf } from "../fake";
import { nextOpen, Pages } from "./pages";

function server(total: number) {
  const asked: number[] = [];
  const fetchPage = async (after: string | null, limit: number): Promise<ItemPage> => {
    const from = after === null ? 0 : Number(after);
    asked.push(limit);
    const end = Math.min(total, from + limit);
    const items = Array.from({ length: end - from }, (_, place) => itemOf(`i${from + place}`));
    return { items, after: end < total ? String(end) : null, total };
  };
  return { asked, fetchPage };
}

test("fetches no more than is needed", async () => {
  const { asked, fetchPage } = server(1000);
  const pages = new Pages(fetchPage);
  await pages.ensure(20);
  expect([pages.items.length, pages.total, asked.length]).toEqual([100, 1000, 1]);
  await pages.ensure(100);
  expect(asked.length).toBe(1);
});

test("a jump to the end takes large pages, and two at once do not fetch twice", async () => {
  const { asked, fetchPage } = server(1000);
  const pages = new Pages(fetchPage);
  await Promise.all([pages.ensure(20), pages.ensure(1000)]);
  expect(pages.items.map((item) => item.id)).toEqual(Array.from({ length: 1000 }, (_, place) => `i${place}`));
  expect(pages.complete).toBe(true);
  expect(asked.length).toBeLessThanOrEqual(4);
});

test("an item that moved in the store meanwhile stands once", async () => {
  let turn = 0;
  const pages = new Pages(async () => {
    turn++;
    const ids = turn === 1 ? ["a", "b"] : ["b", "c"];
    return { items: ids.map((id) => itemOf(id)), after: turn === 1 ? "b" : null, total: 4 };
  });
  await pages.ensure(10);
  expect(pages.items.map((item) => item.id)).toEqual(["a", "b", "c"]);
  expect(pages.total).toBe(3);
});

test("a failure is told, and asking again goes on from there", async () => {
  let fails = true;
  const { fetchPage } = server(150);
  const pages = new Pages(async (after, limit) => {
    if (after !== null && fails) throw new Error("away");
    return fetchPage(after, limit);
  });
  await expect(pages.ensure(150)).rejects.toThrow("away");
  expect(pages.items.length).toBe(100);
  fails = false;
  await pages.ensure(150);
  expect(pages.items.length).toBe(150);
});

test("an updated item keeps its place", async () => {
  const pages = new Pages(server(3).fetchPage);
  await pages.ensure(3);
  pages.update(itemOf("i1", { verdict: "accept" }));
  expect(pages.items[1]?.verdict).toBe("accept");
  expect(pages.indexOf("i1")).toBe(1);
});

test("the next open one leaves out what people decided on", () => {
  const items = ["program", "human", null, "human"].map((decided_by, place) =>
    itemOf(`i${place}`, { decided_by: decided_by as "human" | "program" | null }),
  );
  expect(nextOpen(items, -1)).toBe(0);
  expect(nextOpen(items, 0)).toBe(2);
  expect(nextOpen(items, 2)).toBe(-1);
});
