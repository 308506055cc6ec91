/** Strips of thumbnails: other models, other rotations, and rotations that look alike. */

import { useEffect, useState } from "preact/hooks";
import type { ComponentChildren } from "preact";

import { anglesFromRotation, multiply, rotationFromAngles } from "../../view/angles";
import type { Cad, Rotation } from "../api/types";
import { thumbUrl } from "../api/thumbs";
import { useApp } from "../app_state";
import { sameRotation } from "../state/draft";
import { CommandButton } from "../ui/command_button";
import { Thumb } from "../ui/thumb";

const SETTLED_MS = 180;
const MOST_TWINS = 8;

/** The rotation on the screen once it has come to rest: thumbnails need not follow every degree. */
function useSettled(): Rotation | null {
  const pose = useApp().review.draft.value?.pose ?? null;
  const [settled, setSettled] = useState<Rotation | null>(pose);
  const key = pose ? `${pose.azimuth} ${pose.elevation} ${pose.inplane}` : "";
  useEffect(() => {
    const timer = setTimeout(() => setSettled(pose), settled === null ? 0 : SETTLED_MS);
    return () => clearTimeout(timer);
  }, [key]);
  return settled;
}

export function Strips() {
  const { review } = useApp();
  const rotation = useSettled();
  const draft = review.draft.value;
  if (!draft || !review.detail.value || !rotation) return null;
  return (
    <div class="strips">
      <Candidates rotation={rotation} cad={draft.cad} />
      <Hypotheses rotation={draft.pose} cad={draft.cad} />
      <TwinStrip rotation={rotation} cad={draft.cad} />
    </div>
  );
}

interface StripProps {
  rotation: Rotation;
  cad: Cad;
}

function Candidates({ rotation, cad }: StripProps) {
  const { review, models } = useApp();
  const detail = review.detail.value;
  const candidates = detail?.candidates ?? [];
  const none = detail?.none_probability ?? null;
  const foreign = !candidates.some((each) => each.cad.id === cad.id);
  return (
    <Strip title="Models" more={<CommandButton id="search" icon="search" label="Library" />}>
      {foreign && (
        <Tile
          url={cad.available ? thumbUrl(cad.key, rotation) : null}
          name={cad.name}
          note="chosen"
          chosen
          onChoose={() => undefined}
        />
      )}
      {candidates.map((candidate, place) => (
        <Tile
          key={candidate.cad.id}
          url={candidate.cad.available ? thumbUrl(candidate.cad.key, rotation) : null}
          name={candidate.cad.name}
          digit={place < 9 ? String(place + 1) : ""}
          note={candidate.probability === null ? "" : `${Math.round(candidate.probability * 100)} %`}
          chosen={candidate.cad.id === cad.id}
          disabled={!candidate.cad.available}
          onChoose={() => models.choose(candidate)}
        />
      ))}
      {none !== null && none > 0.005 && (
        <p class="strip-note">{Math.round(none * 100)} % that none of them is it</p>
      )}
    </Strip>
  );
}

function Hypotheses({ rotation, cad }: StripProps) {
  const { review, models } = useApp();
  const hypotheses = review.detail.value?.hypotheses ?? [];
  if (hypotheses.length === 0) return null;
  return (
    <Strip title="Rotations">
      {hypotheses.map((hypothesis, place) => (
        <Tile
          key={place}
          url={cad.available ? thumbUrl(cad.key, hypothesis.rotation) : null}
          name={`azimuth ${hypothesis.rotation.azimuth.toFixed(0)}°`}
          digit={place < 9 ? `Alt ${place + 1}` : ""}
          note={hypothesis.probability === null ? "" : `${Math.round(hypothesis.probability * 100)} %`}
          chosen={sameRotation(hypothesis.rotation, rotation)}
          onChoose={() => models.hypothesis(place)}
        />
      ))}
    </Strip>
  );
}

function TwinStrip({ rotation, cad }: StripProps) {
  const { models } = useApp();
  const { R, name, continuous, key } = models.twins.value;
  if (key !== cad.key || R.length === 0) return null;
  const now = rotationFromAngles(rotation.azimuth, rotation.elevation, rotation.inplane);
  return (
    <Strip title={continuous ? `Looks alike (${name}, all around)` : `Looks alike (${name})`}>
      {R.slice(0, MOST_TWINS).map((S, place) => {
        const there = anglesFromRotation(multiply(now, S));
        return (
          <Tile
            key={place}
            url={thumbUrl(cad.key, there)}
            name={`azimuth ${there.azimuth.toFixed(0)}°`}
            digit={place === 0 ? "T" : ""}
            note=""
            chosen={false}
            onChoose={() => models.twin(place)}
          />
        );
      })}
    </Strip>
  );
}

function Strip({ title, more, children }: { title: string; more?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section class="strip" aria-label={title}>
      <div class="strip-head">
        <h2>{title}</h2>
        {more}
      </div>
      <div class="tiles">{children}</div>
    </section>
  );
}

interface TileProps {
  url: string | null;
  name: string;
  digit?: string;
  note: string;
  chosen: boolean;
  disabled?: boolean;
  onChoose(): void;
}

function Tile({ url, name, digit = "", note, chosen, disabled = false, onChoose }: TileProps) {
  const title = disabled ? `${name}: not in the library that is open` : digit ? `${name} (${digit})` : name;
  return (
    <button
      type="button"
      class="tile"
      aria-pressed={chosen}
      title={title}
      disabled={disabled}
      onClick={onChoose}
    >
      <Thumb url={url} size={64} instead={name} />
      {digit && <kbd aria-hidden="true">{digit}</kbd>}
      <span class="tile-name">{name}</span>
      <span class="tile-note">{note}</span>
    </button>
  );
}
