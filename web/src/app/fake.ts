/** Made-up answers of the server, for tests. */

import { effect } from "@preact/signals";

import { type Api, ApiError } from "./api/client";
import type { Cad, DecisionRequest, Detail, Item, Pose, Session } from "./api/types";
import type { Review } from "./review";

export const POSE: Pose = {
  azimuth: 30,
  elevation: 10,
  inplane: 0,
  focal_px: 800,
  principal_px: [320, 240],
  t_z: 3,
};

export function cadOf(id: string): Cad {
  return {
    id,
    key: id.repeat(8),
    name: `Model ${id}`,
    category: "car",
    licence: "CC0",
    creator: "",
    source: "",
    size_cm: null,
    available: true,
  };
}

export function itemOf(id: string, change: Partial<Item> = {}): Item {
  return {
    id,
    version: 1,
    photo: { sha256: `photo-${id}`, name: `${id}.jpg`, width: 640, height: 480 },
    category: "car",
    cad: { id: "a", name: "Model a" },
    box_iou: 0.8,
    mask_iou: 0.7,
    confidence: 0.4,
    machine_verdict: "review",
    verdict: "review",
    decided_by: "program",
    edited: false,
    thumb: `/api/annotations/${id}/thumb.jpg`,
    ...change,
  };
}

export function detailOf(id: string, change: Partial<Detail> = {}): Detail {
  return {
    id,
    version: 1,
    in_force: true,
    photo: { sha256: `photo-${id}`, name: `${id}.jpg`, width: 640, height: 480, image: `/photo-${id}` },
    detection: {
      category: "car",
      score: 0.9,
      box: [10, 10, 200, 200],
      mask: null,
      source: "test",
      truncated: false,
      tiny: false,
      unsure: false,
      alternatives: [],
    },
    pose: POSE,
    cad: cadOf("a"),
    machine: { pose: POSE, cad: cadOf("a") },
    start: null,
    candidates: ["a", "b"].map((each, place) => ({
      rank: place + 1,
      cad: cadOf(each),
      score: 0.5,
      probability: 0.5,
      rotation: null,
    })),
    hypotheses: [
      {
        rotation: { azimuth: 210, elevation: 10, inplane: 0 },
        score: 0.4,
        probability: 0.4,
        expected_error: null,
        needs_review: null,
      },
    ],
    none_probability: null,
    confidence: 0.4,
    machine_verdict: "review",
    verdict: "review",
    decided_by: "program",
    edited: false,
    box_iou: 0.8,
    mask_iou: 0.7,
    depth: null,
    history: [],
    siblings: [id],
    ...change,
  };
}

const SESSION: Session = {
  version: "0",
  author: "",
  store: "test.db",
  library: { models: 2, categories: { car: 2 } },
  limits: { upload_bytes: 1000, pixels: 1e6 },
  actions: { annotate: true, snap: true, replace: true, example: true },
  formats: [],
  reasons: ["wrong model"],
};

/** A photo that is drawn as soon as its details are there. */
export function drawAtOnce(review: Review): () => void {
  return effect(() => {
    review.drawn.value = review.detail.value?.id ?? "";
  });
}

/** A server of three items in memory, with its optimistic lock. */
export class FakeServer {
  readonly details = new Map(["a1", "b2", "c3"].map((id) => [id, detailOf(id)]));
  readonly decisions: { id: string; request: DecisionRequest }[] = [];
  readonly asked: string[] = [];
  /** The server does not answer: before it has stored the decision, or after. */
  down: "" | "before" | "after" = "";
  private readonly answers = new Map<string, { item: Item; version: number }>();

  readonly api = {
    session: async () => SESSION,
    progress: async () => {
      this.asked.push("progress");
      return { total: this.details.size, decided: this.decisions.length };
    },
    queue: async () => ({
      items: [...this.details.values()].map((detail) => this.item(detail)),
      after: null,
      total: this.details.size,
    }),
    annotation: async (id: string) => this.found(id),
    symmetry: async () => ({ name: "C1", R: [], continuous: false }),
    snap: async (_id: string, _cad: string, pose: Pose) => ({
      pose: { ...pose, azimuth: pose.azimuth + 5 },
      box_iou: 0.9,
      mask_iou: 0.9,
      start_score: 0.5,
      score: 0.9,
      seconds: 0.3,
    }),
    decide: async (id: string, request: DecisionRequest) => this.decide(id, request),
  } as unknown as Api;

  decide(id: string, request: DecisionRequest): { item: Item; version: number } {
    if (this.down === "before") throw new ApiError("The server does not answer.", "network", 0);
    const known = this.answers.get(request.request_id);
    const answer = known ?? this.store(id, request);
    this.answers.set(request.request_id, answer);
    if (this.down === "after") throw new ApiError("The server does not answer.", "network", 0);
    return answer;
  }

  /** As the store does it: what a request does not tell stays. */
  private store(id: string, request: DecisionRequest): { item: Item; version: number } {
    const detail = this.found(id);
    if (request.version !== detail.version || !detail.in_force) {
      const current = { version: detail.version, in_force: detail.in_force, verdict: detail.verdict, by: "Ben" };
      throw new ApiError("Decided meanwhile.", "conflict", 409, current);
    }
    this.decisions.push({ id, request });
    const next = {
      ...detail,
      version: detail.version + 1,
      verdict: request.verdict === "skip" ? detail.verdict : request.verdict,
      decided_by: "human" as const,
      pose: request.pose ?? detail.pose,
      cad: request.cad_id === null ? detail.cad : cadOf(request.cad_id),
      detection: { ...detail.detection, ...request.region },
      edited: request.verdict === "edit",
    };
    this.details.set(id, next);
    return { item: this.item(next), version: next.version };
  }

  private found(id: string): Detail {
    const detail = this.details.get(id);
    if (!detail) throw new ApiError("There is no such annotation.", "not_found", 404);
    return detail;
  }

  private item(detail: Detail): Item {
    const { version, verdict, decided_by, edited } = detail;
    return itemOf(detail.id, { version, verdict, decided_by, edited });
  }
}
