/** Other models and other rotations of the open item, and the rotations at which its model looks the same. */

import { effect, signal } from "@preact/signals";

import { flipped, twin } from "../view/angles";
import type { Candidate, Rotation, Symmetry } from "./api/types";
import type { Review } from "./review";

/** The symmetry of the model on the screen; null while it is unknown. */
export interface Twins {
  readonly key: string;
  readonly name: string;
  readonly continuous: boolean;
  readonly R: readonly (readonly number[])[];
}

export const NO_TWINS: Twins = { key: "", name: "", continuous: false, R: [] };

/** The item itself comes first. */
const SOON_MS = 400;

export class Models {
  readonly twins = signal<Twins>(NO_TWINS);
  private readonly known = new Map<string, Promise<Symmetry>>();
  private nextTwin = 0;
  /** Key of the model whose symmetry is wanted. */
  private asked = "";
  private soon: ReturnType<typeof setTimeout> | undefined;

  constructor(private readonly review: Review) {
    effect(() => {
      const cad = review.draft.value?.cad;
      if (cad?.key === this.asked) return;
      clearTimeout(this.soon);
      this.asked = cad?.key ?? "";
      this.twins.value = NO_TWINS;
      if (cad?.available) this.soon = setTimeout(() => void this.learn(cad.key), SOON_MS);
    });
  }

  candidate(place: number): void {
    const candidate = this.review.detail.peek()?.candidates[place];
    if (candidate) this.choose(candidate);
    else this.review.say(`There is no candidate ${place + 1}.`);
  }

  choose(candidate: Candidate): void {
    if (candidate.cad.available) this.review.setCad(candidate.cad);
    else this.review.say(`${candidate.cad.name} is not in the library that is open.`, "bad");
  }

  hypothesis(place: number): void {
    const rotation = this.review.detail.peek()?.hypotheses[place]?.rotation;
    if (rotation) this.rotate(rotation);
    else this.review.say(`There is no rotation hypothesis ${place + 1}.`);
  }

  rotate(rotation: Rotation): void {
    const pose = this.review.draft.peek()?.pose;
    if (!pose) return;
    const { azimuth, elevation, inplane } = rotation;
    this.review.setPose({ ...pose, azimuth, elevation, inplane });
  }

  flip(): void {
    const pose = this.review.draft.peek()?.pose;
    if (pose) this.review.setPose(flipped(pose));
  }

  twin(place: number): void {
    const pose = this.review.draft.peek()?.pose;
    const R = this.twins.peek().R[place];
    if (pose && R) this.review.setPose(twin(pose, R));
  }

  /** The twins one after the other. */
  cycleTwin(): void {
    const { R, key } = this.twins.peek();
    if (R.length === 0) {
      this.review.say(key ? "This model has no other rotation that looks alike." : "Its symmetry is not known yet.");
      return;
    }
    this.twin(this.nextTwin % R.length);
    this.nextTwin = R.length === 1 ? 0 : this.nextTwin + 1;
  }

  private async learn(key: string): Promise<void> {
    this.nextTwin = 0;
    let found = this.known.get(key);
    if (!found) {
      found = this.review.api.symmetry(key);
      this.known.set(key, found);
      found.catch(() => this.known.delete(key));
    }
    try {
      const { name, continuous, R } = await found;
      if (this.asked === key) this.twins.value = { key, name, continuous, R };
    } catch {
      // Without it there are no twins to offer.
    }
  }
}
