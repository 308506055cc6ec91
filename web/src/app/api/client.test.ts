import { expect, test } from "vitest";

import { Api, ApiError, exportUrl } from "./client";
import { POSE } from "../fake";
import { thumbUrl } from "./thumbs";

function answering(status: number, body: unknown): Api {
  const text = typeof body === "string" ? body : JSON.stringify(body);
  return new Api(async () => new Response(text, { status }));
}

async function refusal(api: Api): Promise<ApiError> {
  const error: unknown = await api.stats().catch((each: unknown) => each);
  if (!(error instanceof ApiError)) throw new Error("no ApiError");
  return error;
}

test("an error is the server's sentence, its kind, and what holds now", async () => {
  const current = { version: 4, in_force: true, verdict: "accept", by: "Ben" };
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

test("an export is an address, for the browser to load", () => {
  expect(exportUrl("coco", ["accept", "edit"])).toBe("/api/export/coco?verdict=accept&verdict=edit");
});

test("jobs are what the server sends, and nothing else passes for them", async () => {
  expect(await answering(200, { items: [] }).jobs()).toEqual([]);
  expect(await answering(200, []).jobs()).toBeUndefined();
});

test("a replacement tells how the old object stands, and no pose of the new model", async () => {
  const sent: unknown[] = [];
  const api = new Api(async (url, init) => {
    sent.push(url, JSON.parse(String(init?.body)));
    return new Response("{}");
  });
  const now = { pose: POSE, cad_id: "old", region: null };
  await api.replace("a1", "new", now, true, false);
  expect(sent).toEqual(["/api/annotations/a1/replace", { cad_id: "new", now, shadow: true, light: false }]);
});

test("thumbnails are asked for in steps of five degrees", () => {
  expect(thumbUrl("k", { azimuth: 358, elevation: -1, inplane: 2.6 })).toBe(
    "/api/cads/k/thumb.png?azimuth=0&elevation=0&inplane=5&size=96",
  );
});
