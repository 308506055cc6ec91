/**
 * The notebook's widget (anywidget): one photo with one model, turned by hand. Everything comes from traits; nothing
 * is fetched. Also what embeds the view elsewhere.
 */
import { PhotoView } from "./view/photo_view";
import { type Display, DISPLAYS, type Pose } from "./view/pose";
import { decodeRle, type Rle } from "./view/rle";

export { RegionEditor } from "./view/region_editor";
export { PhotoView };

/** What anywidget gives of its model. */
interface Traits {
  get(name: string): unknown;
  set(name: string, value: unknown): void;
  on(name: string, use: () => void): void;
  off(name: string, use: () => void): void;
  save_changes(): void;
}

const MOST_HEIGHT = 560;
/** Poses are told to Python no more often, in milliseconds. */
const PAUSE = 80;

const NAMES: Record<Display, string> = {
  blend: "Blend",
  outline: "Outline",
  wireframe: "Wireframe",
  mask: "Mask",
  difference: "Difference",
  photo: "Photo",
};

function render({ model, el }: { model: Traits; el: HTMLElement }): () => void {
  const document = el.ownerDocument;
  const stage = document.createElement("div");
  const bar = document.createElement("div");
  const choice = document.createElement("select");
  const opacity = document.createElement("input");
  const told = document.createElement("span");
  const fault = document.createElement("p");
  Object.assign(stage.style, { position: "relative", width: "100%", height: "400px", background: "#202227" });
  Object.assign(bar.style, { display: "flex", flexWrap: "wrap", gap: "0.75rem", alignItems: "center", padding: "0.4rem 0" });
  Object.assign(told.style, { fontVariantNumeric: "tabular-nums" });
  fault.setAttribute("role", "alert");
  fault.hidden = true;
  for (const name of DISPLAYS) choice.add(new Option(NAMES[name], name));
  choice.setAttribute("aria-label", "Display");
  Object.assign(opacity, { type: "range", min: "0", max: "1", step: "0.01" });
  opacity.setAttribute("aria-label", "Opacity");
  bar.append(choice, opacity, told);
  el.append(stage, bar, fault);

  const sender = later(PAUSE, () => model.save_changes());
  const view = new PhotoView(stage, {
    onPose(pose, done) {
      model.set("pose", pose);
      tellPose(pose);
      if (done) sender.now();
      else sender.soon();
    },
  });

  const tellPose = (pose: Pose): void => {
    const degrees = [pose.azimuth, pose.elevation, pose.inplane].map((angle) => angle.toFixed(1));
    told.textContent = `az ${degrees[0]}° el ${degrees[1]}° ip ${degrees[2]}° f ${pose.focal_px.toFixed(0)} px`;
  };
  const say = (error: unknown): void => {
    fault.textContent = error instanceof Error ? error.message : String(error);
    fault.hidden = false;
  };
  const showPose = (): void => {
    const pose = model.get("pose") as Pose | null;
    if (!pose || !("azimuth" in pose)) return;
    view.setPose(pose);
    tellPose(pose);
  };
  const showDisplay = (): void => {
    choice.value = String(model.get("display") ?? "blend");
    opacity.value = String(model.get("opacity") ?? 0.62);
    view.setDisplay(choice.value as Display, Number(opacity.value), null);
  };
  const showMask = (): void => {
    const mask = model.get("mask_rle") as Rle | null;
    const [width, height] = view.photoSize;
    // The photo's picture has not come yet, or is another.
    const fits = mask && mask.size[0] === height && mask.size[1] === width;
    view.setMask(fits ? decodeRle(mask) : null);
  };
  const showPhoto = async (): Promise<void> => {
    const bytes = bytesOf(model.get("photo_png"));
    if (!bytes) return;
    const url = URL.createObjectURL(new Blob([bytes]));
    try {
      const picture = new Image();
      picture.src = url;
      await picture.decode();
      // A smaller picture of the photo may come with the size that the pose is told in.
      const size = model.get("photo_size") as [number, number] | null | undefined;
      const [width, height] = size ?? [picture.naturalWidth, picture.naturalHeight];
      stage.style.height = `${Math.min(MOST_HEIGHT, (stage.clientWidth || 640) * (height / width))}px`;
      await view.setPhoto(url, width, height);
      showMask();
    } finally {
      URL.revokeObjectURL(url);
    }
  };
  const showModel = async (): Promise<void> => view.setModel(bytesOf(model.get("model_glb")));

  const changes: [string, () => void][] = [
    ["change:pose", showPose],
    ["change:display", showDisplay],
    ["change:opacity", showDisplay],
    ["change:mask_rle", showMask],
    ["change:photo_png", () => void showPhoto().catch(say)],
    ["change:model_glb", () => void showModel().catch(say)],
  ];
  for (const [name, use] of changes) model.on(name, use);
  const chosen = (): void => {
    model.set("display", choice.value);
    model.set("opacity", Number(opacity.value));
    showDisplay();
    sender.soon();
  };
  choice.addEventListener("change", chosen);
  opacity.addEventListener("input", chosen);

  showDisplay();
  showPose();
  showPhoto().catch(say);
  showModel().catch(say);

  return () => {
    for (const [name, use] of changes) model.off(name, use);
    sender.stop();
    view.dispose();
    for (const element of [stage, bar, fault]) element.remove();
  };
}

/** anywidget gives bytes as a DataView. */
function bytesOf(value: unknown): ArrayBuffer | null {
  if (!(value instanceof DataView) || value.byteLength === 0) return null;
  return new Uint8Array(value.buffer, value.byteOffset, value.byteLength).slice().buffer;
}

/** Does something no more often than each `pause` milliseconds. */
function later(pause: number, use: () => void): { soon(): void; now(): void; stop(): void } {
  let waiting: ReturnType<typeof setTimeout> | null = null;
  const stop = (): void => {
    if (waiting !== null) clearTimeout(waiting);
    waiting = null;
  };
  const now = (): void => {
    stop();
    use();
  };
  return { soon: () => void (waiting ??= setTimeout(now, pause)), now, stop };
}

export default { render };
