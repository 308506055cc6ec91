/** What the browser remembers of a person: the name, the theme, how the model is shown. */

export type Theme = "auto" | "light" | "dark";

const THEMES: readonly Theme[] = ["auto", "light", "dark"];

export interface Shelf {
  getItem(key: string): string | null;
  setItem(key: string, value: string): void;
}

export class Settings {
  constructor(private readonly shelf: Shelf | null) {}

  get author(): string {
    return this.read("author").trim();
  }

  set author(name: string) {
    this.write("author", name.trim());
  }

  get theme(): Theme {
    const found = this.read("theme");
    return THEMES.find((each) => each === found) ?? "auto";
  }

  set theme(theme: Theme) {
    this.write("theme", theme);
  }

  get display(): string {
    return this.read("display");
  }

  set display(display: string) {
    this.write("display", display);
  }

  get opacity(): number {
    const found = Number.parseFloat(this.read("opacity"));
    return found >= 0 && found <= 1 ? found : 0.6;
  }

  set opacity(opacity: number) {
    this.write("opacity", String(opacity));
  }

  private read(name: string): string {
    try {
      return this.shelf?.getItem(`cadpose.${name}`) ?? "";
    } catch {
      return "";
    }
  }

  private write(name: string, value: string): void {
    try {
      this.shelf?.setItem(`cadpose.${name}`, value);
    } catch {
      // A browser that keeps nothing: it holds while the page is open.
    }
  }
}

export function nextTheme(theme: Theme): Theme {
  return THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length] ?? "auto";
}
