import { expect, test } from "vitest";

import { detailOf } from "../fake";
import { Details } from "./details";

test("fetches once, warms what is ahead, and forgets failures and the oldest", async () => {
  const asked: string[] = [];
  const warmed: string[] = [];
  let down = false;
  const details = new Details({
    detail: async (id) => {
      asked.push(id);
      if (down) throw new Error("away");
      return detailOf(id);
    },
    warm: (detail) => warmed.push(detail.id),
  });
  await details.ahead(["a", "b"]);
  await details.get("a");
  expect([asked, warmed]).toEqual([["a", "b"], ["a", "b"]]);
  down = true;
  await expect(details.get("c")).rejects.toThrow("away");
  down = false;
  expect((await details.get("c")).id).toBe("c");
  for (let place = 0; place < 50; place++) await details.get(`x${place}`);
  asked.length = 0;
  await details.get("a");
  expect(asked).toEqual(["a"]);
});
