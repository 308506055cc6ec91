import { beforeEach, describe, expect, test } from "vitest";

import type { Detail, Region } from "./api/types";
import { accept, applyMine, decide, loadPhotoAgain, loadTheirs } from "./deciding";
import { cadOf, detailOf, drawAtOnce, FakeServer, POSE } from "./fake";
import { Models } from "./models";
import { snap } from "./refining";
import { Review } from "./review";
import { Settings } from "./state/settings";

let server: FakeServer;
let review: Review;
let stopDrawing: () => void;

beforeEach(async () => {
  server = new FakeServer();
  review = new Review(server.api, new Settings(null));
  stopDrawing = drawAtOnce(review);
  await review.begin(null);
  review.setAuthor("Anna");
});

const turned = { ...POSE, azimuth: 75 };
const NAME: unknown = expect.stringMatching(/^[0-9a-f]{32}$/);

test("begins with the first item on which no person has decided", async () => {
  expect(review.currentId.value).toBe("a1");
  server.decide("a1", { ...plain(), verdict: "accept" });
  const other = new Review(server.api, new Settings(null));
  await other.begin(null);
  expect(other.currentId.value).toBe("b2");
});

test("accepting sends no changes and goes on", async () => {
  await accept(review);
  expect(server.decisions).toEqual([{ id: "a1", request: { ...plain(), request_id: NAME, verdict: "accept" } }]);
  expect(review.currentId.value).toBe("b2");
  expect(review.queue.item("a1")?.decided_by).toBe("human");
});

test("accepting with changes is an edit with just these", async () => {
  review.setPose(turned);
  await accept(review);
  expect(server.decisions[0]?.request).toEqual({ ...plain(), request_id: NAME, verdict: "edit", pose: turned });
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
  server.down = "before";
  await accept(review);
  expect(review.currentId.value).toBe("a1");
  expect(review.draft.value?.pose).toEqual(turned);
  expect(review.notice.value?.tone).toBe("bad");
  server.down = "";
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
    expect(dialog.conflict.current).toEqual({ version: 2, in_force: true, verdict: "edit", by: "Ben" });
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

describe("mine on top", () => {
  const bens: Region = { box: [5, 5, 50, 50], mask: { size: [480, 640], counts: "PP1" } };

  /** Ben has stored another model, pose and region while Anna looked at the machine's. */
  async function quarrel(): Promise<void> {
    const edit = { pose: { ...POSE, azimuth: 5 }, cad_id: "b", region: bens };
    server.decide("a1", { ...plain(), author: "Ben", verdict: "edit", ...edit, request_id: "b".repeat(32) });
    await accept(review);
    const dialog = review.dialog.value;
    if (dialog?.kind !== "conflict") throw new Error("no conflict");
    await applyMine(review, dialog.conflict);
  }

  test("is what was on the screen, also where that was accepted as it stood", async () => {
    await quarrel();
    const stored = server.details.get("a1");
    expect([stored?.cad.id, stored?.pose, stored?.detection.box]).toEqual(["a", POSE, [10, 10, 200, 200]]);
    expect(server.decisions.at(-1)?.request).toMatchObject({ verdict: "edit", cad_id: "a", version: 2 });
  });

  test("keeps nothing of theirs beside one's own changes", async () => {
    review.setPose(turned);
    await quarrel();
    const stored = server.details.get("a1");
    expect([stored?.cad.id, stored?.pose, stored?.detection.box]).toEqual(["a", turned, [10, 10, 200, 200]]);
  });

  test("is an accept where both say the same", async () => {
    server.decide("a1", { ...plain(), author: "Ben", verdict: "edit", pose: turned, request_id: "b".repeat(32) });
    review.setPose(turned);
    await accept(review);
    const dialog = review.dialog.value;
    if (dialog?.kind !== "conflict") throw new Error("no conflict");
    await applyMine(review, dialog.conflict);
    expect(server.decisions.at(-1)?.request).toMatchObject({ verdict: "accept", pose: null, version: 2 });
  });
});

describe("an answer that is lost on the way", () => {
  beforeEach(async () => {
    review.setPose(turned);
    server.down = "after";
    await accept(review);
    server.down = "";
  });

  test("is had by trying again, and the decision is stored once", async () => {
    review.notice.value?.actions[0]?.run();
    await settled();
    expect(server.decisions).toHaveLength(1);
    expect([review.dialog.value, review.currentId.value]).toEqual([null, "b2"]);
  });

  test("is had by deciding the same again", async () => {
    await accept(review);
    expect(server.decisions).toHaveLength(1);
    expect(review.dialog.value).toBeNull();
  });

  test("does not answer for another decision", async () => {
    await decide(review, "reject");
    expect(review.dialog.value?.kind).toBe("conflict");
  });
});

test("an answer in whose place another one holds leads to that one", async () => {
  server.details.set("a1", detailOf("a1", { in_force: false, siblings: ["c3", "a1"] }));
  review.setPose(turned);
  await accept(review);
  const dialog = review.dialog.value;
  if (dialog?.kind !== "conflict") throw new Error("no conflict");
  expect(dialog.conflict.current.in_force).toBe(false);
  await loadPhotoAgain(review, dialog.conflict);
  expect([review.currentId.value, review.dialog.value, review.isDirty("a1")]).toEqual(["c3", null, false]);
});

test("the header's count comes from the light request", async () => {
  server.asked.length = 0;
  await accept(review);
  await settled();
  expect(server.asked).toEqual(["progress"]);
  expect(review.progress.value?.decided).toBe(1);
});

describe("while the next object loads", () => {
  /** Lets the details of b2 arrive. */
  let arrive: () => void;
  let opened: Promise<void>;

  beforeEach(() => {
    const gate = new Promise<void>((resolve) => (arrive = resolve));
    const give = server.api.annotation.bind(server.api);
    server.api.annotation = async (id: string): Promise<Detail> => {
      if (id === "b2") await gate;
      return give(id);
    };
    review.details.forget("b2");
    opened = review.open("b2");
  });

  test("changes go to neither", async () => {
    review.setPose(turned);
    review.preview(turned);
    review.setCad(cadOf("b"));
    review.undo();
    await snap(review, "fast");
    expect(review.draft.value?.pose).toEqual(POSE);
    arrive();
    await opened;
    expect([review.changed.value, review.canUndo.value, review.isDirty("a1")]).toEqual([false, false, false]);
    expect(review.draft.value?.pose).toEqual(POSE);
  });

  test("nothing is decided", async () => {
    await accept(review);
    await decide(review, "skip");
    expect(server.decisions).toEqual([]);
    arrive();
    await opened;
    await accept(review);
    expect(server.decisions.map((each) => each.id)).toEqual(["b2"]);
  });
});

test("nothing is changed or decided before it is drawn", async () => {
  review.drawn.value = "c3";
  review.setPose(turned);
  await accept(review);
  expect([review.changed.value, server.decisions]).toEqual([false, []]);
  review.drawn.value = "a1";
  review.setPose(turned);
  expect(review.changed.value).toBe(true);
});

test("what is held when one goes on stays with its object", async () => {
  review.preview(turned);
  await review.open("b2");
  expect([review.draft.value?.pose, review.isDirty("a1")]).toEqual([POSE, true]);
  await review.open("a1");
  expect(review.draft.value?.pose).toEqual(turned);
  review.undo();
  expect(review.changed.value).toBe(false);
});

test("what is held when one decides is decided on", async () => {
  let held: typeof POSE | null = turned;
  review.endGesture = () => {
    if (held) review.setPose(held);
    held = null;
  };
  await accept(review);
  expect(server.decisions[0]?.request).toMatchObject({ verdict: "edit", pose: turned });
  expect(review.isDirty("b2")).toBe(false);
});

test("another model under the same object has to be drawn first", () => {
  stopDrawing();
  review.show(detailOf("a1", { version: 2 }), review.desk.rebase(detailOf("a1", { version: 2 })));
  expect(review.ready.value).toBe(true);
  const other = detailOf("a1", { version: 3, cad: cadOf("b") });
  review.show(other, review.desk.rebase(other));
  expect(review.ready.value).toBe(false);
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
  const said = { version: 1, author: "Anna", reason: "", note: "" };
  return { ...said, pose: null, cad_id: null, region: null, request_id: "0".repeat(32) };
}

async function settled(): Promise<void> {
  for (let turn = 0; turn < 10; turn++) await Promise.resolve();
  await new Promise((resolve) => setTimeout(resolve, 0));
}
