/** Photos on their way: sent a few at a time, then followed until they are annotated. */

import { type Api, ApiError, sentence } from "../api/client";
import type { Job } from "../api/types";

export type UploadState = "waiting" | "sending" | "queued" | "running" | "done" | "failed";

export interface Upload {
  readonly key: number;
  readonly name: string;
  readonly state: UploadState;
  readonly stage: string;
  readonly share: number;
  readonly error: string;
  readonly annotations: readonly string[];
}

type Maker = Pick<Api, "upload" | "jobs">;

export interface UploadOptions {
  limit: number;
  atOnce?: number;
  pollMs?: number;
  /** Called whenever a photo's annotations are in the store. */
  arrived?(upload: Upload): void;
  wait?(ms: number): Promise<void>;
}

const PICTURES = /\.(jpe?g|png|webp|tiff?|bmp)$/i;
const TRIES = 40;

export function isPicture(name: string): boolean {
  return PICTURES.test(name);
}

export class Uploads {
  list: Upload[] = [];
  private readonly files = new Map<number, Blob>();
  /** Job of each photo; the same photo twice has one job. */
  private readonly jobs = new Map<number, string>();
  private nextKey = 1;
  private sending = 0;
  private polling = false;

  constructor(
    private readonly api: Maker,
    private readonly options: UploadOptions,
    private readonly changed: (list: Upload[]) => void = () => undefined,
  ) {}

  get busy(): boolean {
    return this.list.some((each) => each.state !== "done" && each.state !== "failed");
  }

  add(files: readonly { name: string; blob: Blob }[]): void {
    for (const { name, blob } of files) {
      const key = this.enter(name);
      const refusal = this.refusal(name, blob);
      if (refusal) this.set(key, { state: "failed", error: refusal });
      else this.files.set(key, blob);
    }
    this.pump();
  }

  /** Follows a job that was begun otherwise: the example photo. */
  follow(job: Job): void {
    const key = this.enter(job.name);
    this.jobs.set(key, job.id);
    this.take(key, job);
    void this.poll();
  }

  retry(key: number): void {
    if (!this.files.has(key)) return;
    this.set(key, { state: "waiting", error: "", share: 0 });
    this.pump();
  }

  canRetry(key: number): boolean {
    return this.files.has(key);
  }

  clearFinished(): void {
    this.list = this.list.filter((each) => each.state !== "done" && each.state !== "failed");
    this.changed(this.list);
  }

  private enter(name: string): number {
    const key = this.nextKey++;
    const fresh: Upload = { key, name, state: "waiting", stage: "", share: 0, error: "", annotations: [] };
    this.list = [...this.list, fresh];
    this.changed(this.list);
    return key;
  }

  private refusal(name: string, blob: Blob): string {
    if (!isPicture(name)) return "No photo: JPEG, PNG, WebP, TIFF and BMP are read.";
    if (blob.size === 0) return "The file is empty.";
    if (blob.size > this.options.limit) {
      const most = (this.options.limit / 1048576).toFixed(0);
      return `The file has ${(blob.size / 1048576).toFixed(1)} MiB; at most ${most} MiB are taken.`;
    }
    return "";
  }

  private set(key: number, change: Partial<Upload>): void {
    this.list = this.list.map((each) => (each.key === key ? { ...each, ...change } : each));
    this.changed(this.list);
  }

  private pump(): void {
    while (this.sending < (this.options.atOnce ?? 3)) {
      const next = this.list.find((each) => each.state === "waiting" && this.files.has(each.key));
      if (!next) return;
      this.sending++;
      this.set(next.key, { state: "sending" });
      void this.send(next).finally(() => {
        this.sending--;
        this.pump();
      });
    }
  }

  private async send(upload: Upload): Promise<void> {
    const blob = this.files.get(upload.key);
    if (!blob) return;
    for (let attempt = 1; ; attempt++) {
      try {
        const job = await this.api.upload(upload.name, blob);
        this.jobs.set(upload.key, job.id);
        this.take(upload.key, job);
        void this.poll();
        return;
      } catch (error) {
        // The server takes so many at a time: the others wait here.
        if (error instanceof ApiError && error.kind === "busy" && attempt < TRIES) {
          this.set(upload.key, { stage: "waiting for the server" });
          await this.pause();
          continue;
        }
        this.set(upload.key, { state: "failed", error: sentence(error) });
        if (error instanceof ApiError && !error.passing) this.files.delete(upload.key);
        return;
      }
    }
  }

  private async poll(): Promise<void> {
    if (this.polling) return;
    this.polling = true;
    try {
      let misses = 0;
      while (this.open().length > 0) {
        await this.pause();
        try {
          const jobs = new Map((await this.api.jobs()).map((job) => [job.id, job]));
          misses = 0;
          for (const [key, id] of this.open()) {
            const job = jobs.get(id);
            if (job) this.take(key, job);
            else this.set(key, { state: "failed", error: "The server knows nothing of this photo any more." });
          }
        } catch (error) {
          if (++misses < TRIES && error instanceof ApiError && error.passing) continue;
          for (const [key] of this.open()) this.set(key, { state: "failed", error: sentence(error) });
        }
      }
    } finally {
      this.polling = false;
    }
  }

  private open(): [number, string][] {
    const states = new Map(this.list.map((each) => [each.key, each.state]));
    return [...this.jobs].filter(([key]) => states.get(key) === "queued" || states.get(key) === "running");
  }

  private take(key: number, job: Job): void {
    this.set(key, {
      state: job.state,
      stage: job.stage,
      share: job.state === "done" ? 1 : job.share,
      error: job.error ?? "",
      annotations: job.annotations,
    });
    if (job.state === "done" || job.state === "failed") {
      if (job.state === "done") this.files.delete(key);
      const upload = this.list.find((each) => each.key === key);
      if (job.state === "done" && upload) this.options.arrived?.(upload);
    }
  }

  private pause(): Promise<void> {
    const ms = this.options.pollMs ?? 500;
    return this.options.wait ? this.options.wait(ms) : new Promise((resolve) => setTimeout(resolve, ms));
  }
}
