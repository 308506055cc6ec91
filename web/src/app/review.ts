/** The page's state: the open item, its draft, the queue; components read the signals and call the verbs. */

import { batch, computed, signal } from "@preact/signals";

import { type Api, sentence } from "./api/client";
import type { Cad, DecisionRequest, Detail, Item, Pose, Progress, Region, Session } from "./api/types";
import { type Dialog, type Notice, type Tone } from "./notices";
import { Queue } from "./queue";
import { Details } from "./state/details";
import { type Draft, isChanged, samePose } from "./state/draft";
import type { Settings } from "./state/settings";
import { Desk, type Work } from "./state/work";

export type Drawing = "" | "box" | "mask";
export type Tab = "queue" | "adjust" | "models" | "info";

/** So long a fetched item counts as fresh. */
const FRESH_MS = 15_000;
/** What is fetched ahead waits so long, so as not to hold up the item that is being opened. */
const AHEAD_MS = 300;

export class Review {
  readonly session = signal<Session | null>(null);
  /** Why the page cannot begin, empty while it can. */
  readonly failure = signal("");
  /** How far the store is. */
  readonly progress = signal<Progress | null>(null);
  readonly queue: Queue;
  readonly details: Details;
  readonly desk = new Desk();

  readonly currentId = signal<string | null>(null);
  readonly detail = signal<Detail | null>(null);
  readonly opening = signal(false);
  /** Why the item could not be opened. */
  readonly trouble = signal("");
  /** What is seen: the last committed state, or one on its way while something is dragged. */
  readonly draft = signal<Draft | null>(null);
  readonly base = signal<Draft | null>(null);
  readonly canUndo = signal(false);
  readonly canRedo = signal(false);
  /** Raised whenever the drafts on the desk change. */
  readonly deskTick = signal(0);
  /** What the wipe shows on its left. */
  readonly before = signal<Pose | null>(null);
  readonly iou = signal<number | null>(null);
  readonly drawing = signal<Drawing>("");
  /** The item that stands on the screen, photo and model and all; empty while none does. */
  readonly drawn = signal("");

  readonly busy = signal<"" | "snap" | "save">("");
  readonly dialog = signal<Dialog | null>(null);
  readonly notice = signal<Notice | null>(null);
  readonly author = signal("");
  readonly tab = signal<Tab>("adjust");

  /** Whether the open item is the one that is seen: only then may anything be changed or decided. */
  readonly ready = computed(() => {
    const id = this.currentId.value;
    return id !== null && !this.opening.value && this.detail.value?.id === id && this.drawn.value === id;
  });

  readonly changed = computed(() => {
    const base = this.base.value;
    const draft = this.draft.value;
    return base !== null && draft !== null && isChanged(base, draft);
  });

  /** Brings photo and model of an item into caches; the drawing part hangs itself in here. */
  warm: (detail: Detail) => void = () => undefined;
  private soon: ReturnType<typeof setTimeout> | undefined;
  /** The refinement that is under way; leaving the item ends it. */
  snapping: AbortController | null = null;
  /** Decisions of which no answer came, by item: the next try must bear the same name. */
  readonly unanswered = new Map<string, DecisionRequest>();
  /** Ends what the mouse or a finger is doing to the model, and tells its pose. */
  endGesture: () => void = () => undefined;
  /** Puts the focus on the photo. */
  focusView: () => void = () => undefined;

  constructor(
    readonly api: Api,
    readonly settings: Settings,
  ) {
    this.queue = new Queue(api);
    this.details = new Details({
      detail: (id) => api.annotation(id),
      warm: (detail) => this.warm(detail),
    });
    this.author.value = settings.author;
  }

  /** The work on the item that is seen; none while another one is on its way. */
  get work(): Work | undefined {
    const id = this.currentId.peek();
    return id !== null && this.ready.peek() ? this.desk.get(id) : undefined;
  }

  async begin(wanted: string | null): Promise<void> {
    this.failure.value = "";
    try {
      const session = await this.api.session();
      this.session.value = session;
      if (!this.author.value) this.author.value = session.author;
      void this.refreshProgress();
      await this.queue.reload();
    } catch (error) {
      this.failure.value = sentence(error);
      return;
    }
    if (this.queue.error.value) {
      this.failure.value = this.queue.error.value;
      return;
    }
    const first = wanted ?? this.queue.firstOpen()?.id;
    if (first) await this.open(first);
  }

  async refreshProgress(): Promise<void> {
    try {
      this.progress.value = await this.api.progress();
    } catch {
      // The bar stays as it was.
    }
  }

  async open(id: string): Promise<void> {
    performance.mark("cadpose-open");
    this.settle();
    batch(() => {
      this.currentId.value = id;
      this.trouble.value = "";
      this.opening.value = true;
      this.drawing.value = "";
    });
    this.snapping?.abort();
    try {
      const old = this.details.age(id) > FRESH_MS;
      const detail = await this.details.get(id);
      if (this.currentId.peek() !== id) return;
      this.show(detail, this.desk.open(detail));
      if (old) void this.lookAgain(detail);
    } catch (error) {
      if (this.currentId.peek() !== id) return;
      batch(() => {
        this.trouble.value = sentence(error);
        this.detail.value = null;
        this.draft.value = null;
        this.base.value = null;
      });
    } finally {
      if (this.currentId.peek() === id) this.opening.value = false;
    }
    clearTimeout(this.soon);
    this.soon = setTimeout(() => void this.details.ahead(this.queue.around(id)), AHEAD_MS);
  }

  /** What was fetched a while ago may have been decided on since. */
  private async lookAgain(seen: Detail): Promise<void> {
    try {
      const detail = await this.details.fresh(seen.id);
      // A model that is held has a draft on its way, which is not on the desk yet.
      const touched = this.changed.peek() || this.desk.isDirty(seen.id) || this.busy.peek() !== "";
      const waiting = this.currentId.peek() === seen.id && this.detail.peek() === seen && !touched;
      if (detail.version !== seen.version && waiting) this.show(detail, this.desk.begin(detail));
    } catch {
      // Then the decision will tell.
    }
  }

  show(detail: Detail, work: Work): void {
    batch(() => {
      // Another model has to be seen before it is decided on.
      const other = this.draft.peek()?.cad.key !== work.undo.present.cad.key;
      if (other && this.detail.peek()?.id === detail.id) this.drawn.value = "";
      this.detail.value = detail;
      this.base.value = work.base;
      this.before.value = reference(detail);
      this.iou.value = null;
      this.sync(work);
    });
  }

  async move(by: 1 | -1): Promise<void> {
    const from = this.currentId.peek();
    const next = await this.queue.neighbour(from, by);
    if (this.currentId.peek() !== from) return;
    const trouble = this.queue.error.peek();
    if (next) await this.open(next.id);
    else if (trouble && by > 0) this.say(trouble, "bad");
    else this.say(by > 0 ? "That was the last one of the queue." : "That is the first one of the queue.");
  }

  /** To the next item on which nobody has decided. */
  async moveOn(otherwise = "Stored. People have decided on everything in this list."): Promise<void> {
    const id = this.currentId.peek();
    const next = await this.queue.nextOpen(id);
    if (this.currentId.peek() !== id) return;
    if (next) return this.open(next.id);
    if (id !== null) await this.open(id);
    this.say(otherwise, "good");
  }

  // -- the draft -------------------------------------------------------------------------------

  /** A pose on its way: seen, but no step of the undo history yet. */
  preview(pose: Pose): void {
    const draft = this.draft.peek();
    if (draft && this.work) this.draft.value = { ...draft, pose };
  }

  /** What is on its way becomes a step of undo, before anything else happens to the item. */
  settle(): void {
    this.endGesture();
    const work = this.work;
    if (work && this.draft.peek() !== work.undo.present) this.commit((draft) => draft);
  }

  setPose(pose: Pose, tag = ""): void {
    this.commit((draft) => ({ ...draft, pose }), tag);
  }

  setCad(cad: Cad): void {
    this.commit((draft) => ({ ...draft, cad }));
  }

  setRegion(region: Region, tag = ""): void {
    this.commit((draft) => ({ ...draft, region }), tag);
  }

  commit(change: (draft: Draft) => Draft, tag = ""): void {
    const work = this.work;
    const draft = this.draft.peek();
    if (!work || !draft) return;
    work.undo.push(change(draft), tag);
    this.sync(work);
  }

  undo(): void {
    this.settle();
    const work = this.work;
    if (!work) return;
    if (work.undo.undo()) this.sync(work);
    else this.say("Nothing to undo.");
  }

  redo(): void {
    this.settle();
    const work = this.work;
    if (!work) return;
    if (work.undo.redo()) this.sync(work);
    else this.say("Nothing to redo.");
  }

  /** Back to what is stored; undo brings the changes back. */
  reset(): void {
    this.settle();
    const work = this.work;
    if (!work || !this.changed.peek()) return;
    work.undo.push(work.base);
    this.sync(work);
    this.say("Back to what is stored. Undo brings your changes back.");
  }

  sync(work: Work): void {
    batch(() => {
      this.draft.value = work.undo.present;
      this.canUndo.value = work.undo.canUndo;
      this.canRedo.value = work.undo.canRedo;
      this.deskTick.value++;
    });
  }

  isDirty(id: string): boolean {
    return this.deskTick.value >= 0 && this.desk.isDirty(id);
  }

  // -- talk ------------------------------------------------------------------------------------

  say(text: string, tone: Tone = "info", actions: Notice["actions"] = []): void {
    this.notice.value = { text, tone, actions };
  }

  setAuthor(name: string): void {
    this.author.value = name.trim();
    this.settings.author = name;
  }

  /** The item as the queue now knows it. */
  took(item: Item): void {
    this.queue.update(item);
    void this.refreshProgress();
  }
}

/** The pose that the refinement began from, else the machine's, if it differs from what holds. */
export function reference(detail: Detail): Pose | null {
  if (!samePose(detail.machine.pose, detail.pose)) return detail.machine.pose;
  return detail.start && !samePose(detail.start, detail.pose) ? detail.start : null;
}
