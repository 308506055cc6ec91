/** Everything that the components share. */

import { signal } from "@preact/signals";
import { createContext } from "preact";
import { useContext } from "preact/hooks";

import { Api } from "./api/client";
import { Display } from "./display";
import { Models } from "./models";
import { Review } from "./review";
import { Settings, type Theme, nextTheme } from "./state/settings";
import { type Upload, Uploads } from "./state/uploads";

const GATHER_MS = 300;

export class App {
  readonly review: Review;
  readonly display: Display;
  readonly models: Models;
  readonly theme = signal<Theme>("auto");
  readonly uploads = signal<readonly Upload[]>([]);
  /** Set by the list of the queue. */
  focusQueue: () => void = () => undefined;
  /** Set by the photo. */
  toggleZoom: () => void = () => undefined;
  private refreshing: Promise<void> | null = null;
  private sender: Uploads | null = null;

  constructor(
    readonly api: Api,
    readonly settings: Settings,
  ) {
    this.review = new Review(api, settings);
    this.display = new Display(settings);
    this.models = new Models(this.review);
    this.theme.value = settings.theme;
  }

  get uploader(): Uploads {
    this.sender ??= new Uploads(
      this.api,
      {
        limit: this.review.session.peek()?.limits.upload_bytes ?? Number.POSITIVE_INFINITY,
        arrived: (upload) => void this.arrived(upload),
      },
      (list) => {
        this.uploads.value = list;
      },
    );
    return this.sender;
  }

  cycleTheme(): void {
    this.theme.value = nextTheme(this.theme.peek());
    this.settings.theme = this.theme.peek();
    const told = { auto: "Colours as the system has them.", light: "Light colours.", dark: "Dark colours." };
    this.review.say(told[this.theme.peek()]);
  }

  private async arrived(upload: Upload): Promise<void> {
    const { review } = this;
    const count = upload.annotations.length;
    await this.refreshQueue();
    const first = upload.annotations[0];
    const found = count === 0 ? "nothing to annotate was found" : `${count} object${count > 1 ? "s" : ""}`;
    review.say(
      `${upload.name}: ${found}.`,
      count > 0 ? "good" : "info",
      first === undefined ? [] : [{ label: "Show it", run: () => this.show(first) }],
    );
    if (first !== undefined && review.currentId.peek() === null) await review.open(first);
  }

  /** Photos that arrive close together make one refresh, or two. */
  private refreshQueue(): Promise<void> {
    this.refreshing ??= (async () => {
      await new Promise((resolve) => setTimeout(resolve, GATHER_MS));
      this.refreshing = null;
      await this.review.queue.reload();
      void this.review.refreshProgress();
    })();
    return this.refreshing;
  }

  show(id: string): void {
    this.review.dialog.value = null;
    void this.review.open(id);
  }
}

const Context = createContext<App | null>(null);

export const AppProvider = Context.Provider;

export function useApp(): App {
  const app = useContext(Context);
  if (!app) throw new Error("no App above this component");
  return app;
}
