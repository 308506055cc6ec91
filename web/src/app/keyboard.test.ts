// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, test } from "vitest";

import { App } from "./app_state";
import { drawAtOnce, FakeServer, POSE } from "./fake";
import { listen } from "./keyboard";
import { Settings } from "./state/settings";

let server: FakeServer;
let app: App;
let end: () => void;

beforeEach(async () => {
  server = new FakeServer();
  app = new App(server.api, new Settings(null));
  drawAtOnce(app.review);
  await app.review.begin(null);
  app.review.setAuthor("Anna");
  end = listen(app, window);
});

afterEach(() => end());

async function hold(key: string, target: EventTarget = document.body): Promise<KeyboardEvent> {
  let event = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true });
  target.dispatchEvent(event);
  for (let time = 0; time < 5; time++) {
    await new Promise((resolve) => setTimeout(resolve, 0));
    event = new KeyboardEvent("keydown", { key, repeat: true, bubbles: true, cancelable: true });
    target.dispatchEvent(event);
  }
  await new Promise((resolve) => setTimeout(resolve, 0));
  return event;
}

test("a held key decides once", async () => {
  await hold("a");
  expect(server.decisions.map((each) => each.id)).toEqual(["a1"]);
  await hold("n");
  expect(server.decisions.map((each) => each.id)).toEqual(["a1", "b2"]);
});

test("a held key turns and flips once", async () => {
  await hold("ArrowRight");
  expect(app.review.draft.value?.pose.azimuth).toBe(POSE.azimuth + 6);
  app.review.reset();
  await hold("f");
  expect(app.review.draft.value?.pose.azimuth).toBe(POSE.azimuth + 180);
});

test("a held Enter presses a button once", async () => {
  const button = document.body.appendChild(document.createElement("button"));
  expect((await hold("Enter", button)).defaultPrevented).toBe(true);
  const once = new KeyboardEvent("keydown", { key: "Enter", bubbles: true, cancelable: true });
  button.dispatchEvent(once);
  expect(once.defaultPrevented).toBe(false);
  button.remove();
});

test("J goes on where the page of the queue comes late", async () => {
  const give = server.api.queue.bind(server.api);
  server.api.queue = async (query) => {
    const page = await give(query);
    await new Promise((resolve) => setTimeout(resolve, 20));
    const from = typeof query.after === "string" ? 1 : 0;
    return { ...page, items: from ? page.items.slice(1) : page.items.slice(0, 1), after: from ? null : "next" };
  };
  await app.review.queue.narrow({ ...app.review.queue.filters.value });
  await app.review.move(1);
  expect([app.review.currentId.value, app.review.notice.value]).toEqual(["b2", null]);
});
