/** The divider between before and after: dragged, or moved by the arrow keys. */

const STEP = 0.02;
const HIT = 24;

export class Wipe {
  readonly element: HTMLElement;
  private share = 0.5;

  constructor(
    container: HTMLElement,
    private readonly tell: (share: number) => void,
  ) {
    const element = container.ownerDocument.createElement("div");
    const line = container.ownerDocument.createElement("div");
    element.append(line);
    this.element = element;
    element.tabIndex = 0;
    for (const [name, value] of Object.entries({
      role: "slider",
      "aria-label": "Divider between before and after",
      "aria-orientation": "horizontal",
      "aria-valuemin": "0",
      "aria-valuemax": "100",
    })) {
      element.setAttribute(name, value);
    }
    Object.assign(element.style, {
      position: "absolute",
      top: "0",
      bottom: "0",
      width: `${HIT}px`,
      marginLeft: `${-HIT / 2}px`,
      cursor: "ew-resize",
      touchAction: "none",
      display: "none",
    });
    Object.assign(line.style, {
      position: "absolute",
      top: "0",
      bottom: "0",
      left: `${HIT / 2 - 1}px`,
      width: "2px",
      background: "#fff",
      boxShadow: "0 0 0 1px rgb(0 0 0 / 60%)",
    });
    element.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      element.setPointerCapture(event.pointerId);
    });
    element.addEventListener("pointermove", (event) => {
      if (!element.hasPointerCapture(event.pointerId)) return;
      const { left, width } = container.getBoundingClientRect();
      this.change((event.clientX - left) / Math.max(width, 1));
    });
    element.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (way === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.change(this.share + way * STEP * (event.shiftKey ? 5 : 1));
    });
    container.append(element);
  }

  /** Null hides it. */
  show(share: number | null): void {
    this.element.style.display = share === null ? "none" : "block";
    if (share === null) return;
    this.share = share;
    this.element.style.left = `${100 * share}%`;
    this.element.setAttribute("aria-valuenow", String(Math.round(100 * share)));
  }

  private change(share: number): void {
    const kept = Math.min(Math.max(share, 0), 1);
    this.show(kept);
    this.tell(kept);
  }
}
