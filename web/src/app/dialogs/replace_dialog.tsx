/** Another model in the object's place in the photo: choose it, look, download. */

import { useEffect, useRef, useState } from "preact/hooks";

import { isAbort, sentence } from "../api/client";
import type { Cad, Replaced } from "../api/types";
import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";
import { Icon } from "../ui/icon";
import { Compare } from "../ui/compare";
import { LibraryPicker } from "./library_picker";

export function ReplaceDialog({ onClose }: { onClose(): void }) {
  const { api, review } = useApp();
  const detail = review.detail.value;
  const draft = review.draft.value;
  const [cad, setCad] = useState<Cad | null>(null);
  const [shadow, setShadow] = useState(true);
  const [light, setLight] = useState(true);
  const [working, setWorking] = useState(false);
  const [trouble, setTrouble] = useState("");
  const [made, setMade] = useState<Replaced | null>(null);
  const calling = useRef<AbortController | null>(null);
  useEffect(() => () => calling.current?.abort(), []);

  if (!detail || !draft) return null;
  const { photo } = detail;

  async function make(): Promise<void> {
    if (!detail || !draft || !cad) return;
    const controller = new AbortController();
    calling.current = controller;
    setWorking(true);
    setTrouble("");
    const now = { pose: draft.pose, cad_id: draft.cad.id, region: draft.region };
    try {
      setMade(await api.replace(detail.id, cad.id, now, shadow, light, controller.signal));
    } catch (error) {
      if (isAbort(error)) return;
      setTrouble(sentence(error));
    }
    setWorking(false);
  }

  if (review.session.value?.actions.replace === false) {
    return (
      <Dialog title="Replace in the photo" onClose={onClose}>
        <p class="hint">
          This needs the photo and the library: start the page with <code>--photos DIR --library DIR</code>.
        </p>
      </Dialog>
    );
  }
  return (
    <Dialog title={`Replace the ${detail.detection.category} in the photo`} wide onClose={onClose}>
      <div class="replace">
        {made && photo.image ? (
          <Compare before={photo.image} after={made.picture} width={photo.width} height={photo.height} />
        ) : (
          <LibraryPicker
            category={detail.detection.category}
            rotation={draft.pose}
            chosen={cad?.id ?? ""}
            onChoose={setCad}
          />
        )}
        <div class="replace-bar">
          <span class="replace-with">
            With: <b>{cad?.name ?? "choose a model"}</b>
          </span>
          <label class="choice">
            <input type="checkbox" checked={shadow} onChange={() => setShadow(!shadow)} />
            <span>Shadow</span>
          </label>
          <label class="choice">
            <input type="checkbox" checked={light} onChange={() => setLight(!light)} />
            <span>Light of the photo</span>
          </label>
          <span class="spring" />
          {made && (
            <>
              <button type="button" class="command" onClick={() => setMade(null)}>
                Another model
              </button>
              <a class="command" href={made.picture} download="replaced.png">
                <Icon name="download" />
                <span>Picture</span>
              </a>
              <a class="command" href={made.scene} download="replaced.glb">
                <Icon name="download" />
                <span>Scene (GLB)</span>
              </a>
            </>
          )}
          <button type="button" class="command main" disabled={!cad || working} onClick={() => void make()}>
            {working && <span class="spinner" aria-hidden="true" />}
            <span>{working ? "Working …" : made ? "Once more" : "Replace"}</span>
          </button>
        </div>
        <p role="status" class="hint">
          {made && `Made in ${made.seconds.toFixed(1)} s.`}
        </p>
        {trouble && (
          <p class="problem" role="alert">
            {trouble}
          </p>
        )}
      </div>
    </Dialog>
  );
}
