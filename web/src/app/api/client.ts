/** The server's verbs as typed functions; everything that goes wrong is an ApiError with one sentence. */

import type {
  Cad,
  Current,
  DecisionRequest,
  Detail,
  ErrorKind,
  Item,
  ItemPage,
  Job,
  Pose,
  Progress,
  Region,
  Replaced,
  Session,
  Snapped,
  Standing,
  Stats,
  Symmetry,
} from "./types";

export class ApiError extends Error {
  constructor(
    message: string,
    readonly kind: ErrorKind,
    readonly status: number,
    readonly current: Current | null = null,
  ) {
    super(message);
    this.name = "ApiError";
  }

  /** Whether the same request may well succeed a moment later. */
  get passing(): boolean {
    return this.kind === "network" || this.kind === "busy";
  }
}

const GONE = "The server does not answer. It may have been stopped; nothing here is lost.";
const SHUT = "This page's session has ended. Open the address that `cadpose review` printed once more.";

type Query = Record<string, string | number | readonly string[] | null | undefined>;

export function queryString(query: Query): string {
  const parameters = new URLSearchParams();
  for (const [name, value] of Object.entries(query)) {
    if (value === null || value === undefined || value === "") continue;
    if (Array.isArray(value)) for (const each of value) parameters.append(name, String(each));
    else parameters.set(name, String(value));
  }
  const text = parameters.toString();
  return text ? `?${text}` : "";
}

/** Where the store is had as a file of that format. */
export function exportUrl(format: string, verdicts: readonly string[]): string {
  return `/api/export/${encodeURIComponent(format)}${queryString({ verdict: verdicts })}`;
}

export type Fetch = (url: string, init?: RequestInit) => Promise<Response>;

export class Api {
  constructor(private readonly fetch_: Fetch = (url, init) => fetch(url, init)) {}

  session(): Promise<Session> {
    return this.get("/api/session");
  }

  queue(query: Query, signal?: AbortSignal): Promise<ItemPage> {
    return this.get(`/api/queue${queryString(query)}`, signal);
  }

  annotation(id: string, signal?: AbortSignal): Promise<Detail> {
    return this.get(`/api/annotations/${encodeURIComponent(id)}`, signal);
  }

  decide(id: string, request: DecisionRequest): Promise<{ item: Item; version: number }> {
    return this.post(`/api/annotations/${encodeURIComponent(id)}/decisions`, request);
  }

  snap(
    id: string,
    cad_id: string,
    pose: Pose,
    mode: "fast" | "full",
    region: Region | null,
    signal?: AbortSignal,
  ): Promise<Snapped> {
    return this.post("/api/snap", { annotation_id: id, cad_id, pose, mode, region }, signal);
  }

  cads(query: Query, signal?: AbortSignal): Promise<{ items: Cad[]; after: string | null }> {
    return this.get(`/api/cads${queryString(query)}`, signal);
  }

  symmetry(key: string, signal?: AbortSignal): Promise<Symmetry> {
    return this.get(`/api/cads/${encodeURIComponent(key)}/symmetry`, signal);
  }

  upload(name: string, body: Blob): Promise<Job> {
    return this.send(`/api/photos${queryString({ name })}`, {
      method: "POST",
      body,
      headers: { "content-type": body.type || "application/octet-stream" },
    });
  }

  example(): Promise<Job> {
    return this.post("/api/photos/example", {});
  }

  async jobs(): Promise<Job[]> {
    return (await this.get<{ items: Job[] }>("/api/jobs")).items;
  }

  /** Puts the model `cad_id` in the place of the object, which stands as `now` tells. */
  replace(
    id: string,
    cad_id: string,
    now: Standing,
    shadow: boolean,
    light: boolean,
    signal?: AbortSignal,
  ): Promise<Replaced> {
    const url = `/api/annotations/${encodeURIComponent(id)}/replace`;
    return this.post(url, { cad_id, now, shadow, light }, signal);
  }

  progress(): Promise<Progress> {
    return this.get("/api/progress");
  }

  stats(): Promise<Stats> {
    return this.get("/api/stats");
  }

  private get<T>(url: string, signal?: AbortSignal): Promise<T> {
    return this.send(url, signal ? { signal } : {});
  }

  private post<T>(url: string, body: unknown, signal?: AbortSignal): Promise<T> {
    return this.send(url, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body),
      ...(signal ? { signal } : {}),
    });
  }

  private async send<T>(url: string, init: RequestInit): Promise<T> {
    let response: Response;
    try {
      response = await this.fetch_(url, { credentials: "same-origin", ...init });
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") throw error;
      throw new ApiError(GONE, "network", 0);
    }
    if (response.ok) return (await response.json()) as T;
    throw await refusal(response);
  }
}

async function refusal(response: Response): Promise<ApiError> {
  if (response.status === 401) return new ApiError(SHUT, "forbidden", 401);
  try {
    const said = (await response.json()) as { error?: string; kind?: ErrorKind; current?: Current };
    if (typeof said.error === "string") {
      return new ApiError(said.error, said.kind ?? "failed", response.status, said.current ?? null);
    }
  } catch {
    // Not JSON: told by its number below.
  }
  return new ApiError(`The server answered with ${response.status}.`, "failed", response.status);
}

/** Whether it only says that the page itself called the request off. */
export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

export function sentence(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
