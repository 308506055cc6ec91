import { expect, test } from "vitest";

import { ApiError } from "../api/client";
import type { Job } from "../api/types";
import { type Upload, Uploads } from "./uploads";

function jobOf(id: string, name: string, change: Partial<Job> = {}): Job {
  return {
    id,
    name,
    state: "queued",
    stage: "",
    share: 0,
    error: null,
    photo_sha256: null,
    annotations: [],
    seconds: null,
    ...change,
  };
}

class Server {
  readonly jobsById = new Map<string, Job>();
  sending = 0;
  most = 0;
  busyFor = 0;
  refused = new Set<string>();

  upload = async (name: string): Promise<Job> => {
    this.sending++;
    this.most = Math.max(this.most, this.sending);
    await Promise.resolve();
    this.sending--;
    if (this.busyFor-- > 0) throw new ApiError("Too many at a time.", "busy", 503);
    if (this.refused.has(name)) throw new ApiError("This is no picture.", "bad_input", 422);
    const job = jobOf(`job-${name}`, name);
    this.jobsById.set(job.id, job);
    return job;
  };

  jobs = async (): Promise<Job[]> => {
    const now = [...this.jobsById.values()];
    for (const job of now) {
      const next: Partial<Job> =
        job.state === "queued"
          ? { state: "running", stage: "detecting", share: 0.3 }
          : { state: "done", share: 1, annotations: [`${job.name}-1`] };
      this.jobsById.set(job.id, { ...job, ...next });
    }
    return now;
  };
}

const wait = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 0));
const file = (name: string, size = 10) => ({ name, blob: new Blob(["x".repeat(size)]) });

async function finish(uploads: Uploads): Promise<Upload[]> {
  for (let turn = 0; turn < 500 && uploads.busy; turn++) await wait();
  return uploads.list;
}

test("sends a few at a time and follows each until it is annotated", async () => {
  const server = new Server();
  const arrived: string[] = [];
  const seen = new Set<string>();
  const uploads = new Uploads(
    server,
    { limit: 1000, atOnce: 2, wait, arrived: (upload) => arrived.push(upload.name) },
    (list) => list.forEach((each) => seen.add(each.state)),
  );
  uploads.add(["a.jpg", "b.png", "c.webp", "d.jpeg"].map((name) => file(name)));
  const list = await finish(uploads);
  expect(list.map((each) => [each.state, each.annotations])).toEqual(
    ["a.jpg", "b.png", "c.webp", "d.jpeg"].map((name) => ["done", [`${name}-1`]]),
  );
  expect(server.most).toBe(2);
  expect(arrived).toHaveLength(4);
  expect(seen).toEqual(new Set(["waiting", "sending", "queued", "running", "done"]));
});

test("tells what is wrong with each file and goes on with the others", async () => {
  const server = new Server();
  server.refused.add("bad.jpg");
  const uploads = new Uploads(server, { limit: 100, wait });
  uploads.add([file("notes.txt"), file("big.jpg", 500), file("empty.jpg", 0), file("bad.jpg"), file("ok.jpg")]);
  const list = await finish(uploads);
  expect(list.map((each) => each.state)).toEqual(["failed", "failed", "failed", "failed", "done"]);
  expect(list[0]?.error).toContain("JPEG");
  expect(list[1]?.error).toContain("at most");
  expect(list[3]?.error).toBe("This is no picture.");
  expect(uploads.canRetry(list[3]?.key ?? 0)).toBe(false);
});

test("the same photo twice is one job and two lines that both end", async () => {
  const server = new Server();
  const uploads = new Uploads(server, { limit: 100, wait });
  uploads.add([file("a.jpg"), file("a.jpg")]);
  expect((await finish(uploads)).map((each) => each.state)).toEqual(["done", "done"]);
});

test("waits while the server is busy", async () => {
  const server = new Server();
  server.busyFor = 3;
  const uploads = new Uploads(server, { limit: 100, wait });
  uploads.add([file("a.jpg")]);
  expect((await finish(uploads))[0]?.state).toBe("done");
});

test("a photo that was not sent can be sent again", async () => {
  const server = new Server();
  let away = true;
  const uploads = new Uploads(
    {
      jobs: server.jobs,
      upload: async (name) => {
        if (away) throw new ApiError("The server does not answer.", "network", 0);
        return server.upload(name);
      },
    },
    { limit: 100, wait },
  );
  uploads.add([file("a.jpg")]);
  const [failed] = await finish(uploads);
  expect(failed?.state).toBe("failed");
  away = false;
  uploads.retry(failed?.key ?? 0);
  expect((await finish(uploads))[0]?.state).toBe("done");
});
