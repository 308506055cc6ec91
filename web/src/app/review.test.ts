import { beforeEach, describe, expect, test } from "vitest";

import { accept, applyMine, decide, loadTheirs } from "./deciding";
import { FakeServer, POSE } from "./fake";
import { Models } from "./models";
import { snap } from "./refining";
import { Review } from "./review";
import { Settings } from "./state/settings";

let server: FakeServer;
let review: Review;

beforeEach(async () => {
  server = new FakeServer();
  review = new Review(server.api, new Settings(null));
  await review.begin(null);
  review.setAuthor("Anna");
});

const turned = { ...POSE, azimuth: 75 };

test("begins with the first item on which no person has decided", async () => {
  expect(review.currentId.value).toBe("a1");
  server.decide("a1", { ...plain(), verdict: "accept" });
  const other = new Review(server.api, new Settings(null));
  await other.begin(null);
  expect(other.currentId.value).toBe("b2");
});

test("accepting sends no changes and goes on", async () => {
  await accept(review);
  expect(server.decisions).toEqual([{ id: "a1", request: { ...plain(), verdict: "accept" } }]);
  expect(review.currentId.value).toBe("b2");
  expect(review.queue.item("a1")?.decided_by).toBe("human");
});

test("accepting with changes is an edit with just these", async () => {
  review.setPose(turned);
  await accept(review);
  expect(server.decisions[0]?.request).toEqual({ ...plain(), verdict: "edit", pose: turned });
});

test("asks for a name before the first decision and then stores it", async () => {
  review.author.value = "";
  await accept(review);
  expect(server.decisions).toEqual([]);
  const dialog = review.dialog.value;
  expect(dialog?.kind).toBe("author");
  review.setAuthor("Ben");
  if (dialog?.kind === "author") dialog.then?.();
  await settled();
  expect(server.decisions[0]?.request.author).toBe("Ben");
});

test("changes stay on the desk when one leaves, and come back with their history", async () => {
  review.setPose(turned);
  await review.open("b2");
  expect(review.changed.value).toBe(false);
  expect(review.isDirty("a1")).toBe(true);
  await review.open("a1");
  expect(review.draft.value?.pose).toEqual(turned);
  review.undo();
  expect(review.changed.value).toBe(false);
});

test("nothing is lost while the server is away, and the same decision can be sent again", async () => {
  review.setPose(turned);
  server.down = true;
  await accept(review);
  expect(review.currentId.value).toBe("a1");
  expect(review.draft.value?.pose).toEqual(turned);
  expect(review.notice.value?.tone).toBe("bad");
  server.down = false;
  review.notice.value?.actions[0]?.run();
  await settled();
  expect(server.decisions[0]?.request.pose).toEqual(turned);
});

describe("somebody was quicker", () => {
  beforeEach(async () => {
    review.setPose(turned);
    server.decide("a1", { ...plain(), author: "Ben", verdict: "edit", pose: { ...POSE, azimuth: 5 } });
    await accept(review);
  });

  test("the dialogue tells who, and nothing of one's own is stored or lost", () => {
    const dialog = review.dialog.value;
    expect(dialog?.kind).toBe("conflict");
    if (dialog?.kind !== "conflict") return;
    expect(dialog.conflict.current).toEqual({ version: 2, verdict: "edit", by: "Ben" });
    expect(server.decisions).toHaveLength(1);
    expect(review.draft.value?.pose).toEqual(turned);
  });

  test("theirs can be loaded, and redo brings back one's own", async () => {
    const dialog = review.dialog.value;
    if (dialog?.kind !== "conflict") throw new Error("no conflict");
    await loadTheirs(review, dialog.conflict);
    expect(review.draft.value?.pose.azimuth).toBe(5);
    expect(review.changed.value).toBe(false);
    review.redo();
    expect(review.draft.value?.pose).toEqual(turned);
    await accept(review);
    expect(server.decisions.at(-1)?.request).toMatchObject({ version: 2, verdict: "edit", pose: turned });
  });

  test("one's own can be stored on top", async () => {
    const dialog = review.dialog.value;
    if (dialog?.kind !== "conflict") throw new Error("no conflict");
    await applyMine(review, dialog.conflict);
    expect(server.decisions.at(-1)?.request).toMatchObject({ version: 2, author: "Anna", pose: turned });
    expect(review.dialog.value).toBeNull();
  });
});

test("a skip keeps the draft, and the later decision fits the new version", async () => {
  review.setPose(turned);
  await decide(review, "skip");
  await review.open("a1");
  expect(review.draft.value?.pose).toEqual(turned);
  await accept(review);
  expect(server.decisions.at(-1)?.request).toMatchObject({ verdict: "edit", version: 2 });
});

test("a snap is one step of undo and shows what was before", async () => {
  await snap(review, "fast");
  expect(review.draft.value?.pose.azimuth).toBe(35);
  expect(review.before.value).toEqual(POSE);
  expect(review.notice.value?.text).toContain("azimuth +5.0°");
  review.undo();
  expect(review.draft.value?.pose).toEqual(POSE);
});

test("models and rotations by number, each one step of undo", () => {
  const models = new Models(review);
  models.candidate(1);
  expect(review.draft.value?.cad.id).toBe("b");
  models.hypothesis(0);
  expect(review.draft.value?.pose.azimuth).toBe(210);
  models.flip();
  expect(review.draft.value?.pose.azimuth).toBe(30);
  models.candidate(7);
  expect(review.notice.value?.text).toBe("There is no candidate 8.");
  review.undo();
  review.undo();
  review.undo();
  expect(review.changed.value).toBe(false);
});

test("what is dragged is seen at once and one step when it ends", () => {
  review.preview({ ...POSE, azimuth: 40 });
  review.preview({ ...POSE, azimuth: 50 });
  expect(review.draft.value?.pose.azimuth).toBe(50);
  review.setPose({ ...POSE, azimuth: 55 });
  review.undo();
  expect(review.draft.value?.pose.azimuth).toBe(30);
});

function plain() {
  return { version: 1, author: "Anna", reason: "", note: "", pose: null, cad_id: null, region: null };
}

async function settled(): Promise<void> {
  for (let turn = 0; turn < 10; turn++) await Promise.resolve();
  await new Promise((resolve) => setTimeout(resolve, 0));
}
