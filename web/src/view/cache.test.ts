import { expect, it } from "vitest";

import { Cache } from "./cache";

it("loads once, and drops what was asked for longest ago", async () => {
  const loaded: string[] = [];
  const dropped: string[] = [];
  const cache = new Cache<string>(
    2,
    async (key) => (loaded.push(key), key),
    (value) => dropped.push(value),
  );
  await Promise.all([cache.get("a"), cache.get("a"), cache.get("b")]);
  await cache.get("a");
  await cache.get("c");
  expect(loaded).toEqual(["a", "b", "c"]);
  expect(dropped).toEqual(["b"]);
  await cache.get("b");
  expect(loaded).toEqual(["a", "b", "c", "b"]);
});

it("tries again what could not be loaded", async () => {
  let failing = true;
  const cache = new Cache<string>(2, async (key) => {
    if (failing) throw new Error("not there");
    return key;
  });
  await expect(cache.get("a")).rejects.toThrow("not there");
  failing = false;
  expect(await cache.get("a")).toBe("a");
});
