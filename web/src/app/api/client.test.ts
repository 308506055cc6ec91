import { expect, test } from "vitest";

import { Api, ApiError } from "./client";
import { thumbUrl } from "./thumbs";

function answering(status: number, body: unknown, headers: Record<string, string> = {}): Api {
  const text = typeof body === "string" ? body : JSON.stringify(body);
  return new Api(async () => new Response(text, { status, headers }));
}

async function refusal(api: Api): Promise<ApiError> {
  const error: unknown = await api.stats().catch((each: unknown) => each);
  if (!(error instanceof ApiError)) throw new Error("no ApiError");
  return error;
}

test("an error is the server's sentence, its kind, and what holds now", async () => {
  const current = { version: 4, verdict: "accept", by: "Ben" };
  const error = await refusal(answering(409, { error: "Changed.", kind: "conflict", current }));
  expect([error.message, error.kind, error.current, error.passing]).toEqual(["Changed.", "conflict", current, false]);
});

test("an answer that is not JSON is told by its number", async () => {
  expect((await refusal(answering(502, "<html>"))).message).toContain("502");
});

test("a server that is gone may come back", async () => {
  const error = await refusal(
    new Api(async () => {
      throw new TypeError("Failed to fetch");
    }),
  );
  expect([error.kind, error.passing]).toEqual(["network", true]);
});

test("an ended session says what to open", async () => {
  expect((await refusal(answering(401, { error: "no", kind: "forbidden" }))).message).toContain("cadpose review");
});

test("an export has the server's name", async () => {
  const api = answering(200, "{}", { "content-disposition": 'attachment; filename="coco.json"' });
  expect((await api.export("coco", ["accept"])).name).toBe("coco.json");
});

test("thumbnails are asked for in steps of five degrees", () => {
  expect(thumbUrl("k", { azimuth: 358, elevation: -1, inplane: 2.6 })).toBe(
    "/api/cads/k/thumb.png?azimuth=0&elevation=0&inplane=5&size=96",
  );
});
