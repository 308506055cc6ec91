/** What is known of the object: detection, model, the other objects of the photo, and who said what. */

import { useApp } from "../app_state";
import type { Detail, Happening } from "../api/types";
import { verdictLabel } from "../state/filters";
import { CommandButton } from "../ui/command_button";

export function InfoPanel() {
  const { review } = useApp();
  const detail = review.detail.value;
  const cad = review.draft.value?.cad;
  if (!detail || !cad) return null;
  const { detection, photo } = detail;
  const flags = (["truncated", "tiny", "unsure"] as const).filter((flag) => detection[flag]);
  const alternatives = detection.alternatives.map(([name, score]) => `${name} ${score.toFixed(2)}`);
  return (
    <section class="panel info" aria-labelledby="info-head">
      <h2 id="info-head">
        {detection.category} <small>{photo.name}</small>
      </h2>
      <dl>
        <Row name="Confidence" value={percent(detail.confidence)} />
        <Row name="Machine says" value={detail.machine_verdict?.replace("_", " ") ?? "–"} />
        <Row name="Stands as" value={standing(detail)} />
        <Row name="Found by" value={`${detection.source}, score ${detection.score.toFixed(2)}`} />
        {flags.length > 0 && <Row name="Flags" value={flags.join(", ")} />}
        {alternatives.length > 0 && <Row name="Or else" value={alternatives.join(", ")} />}
        <Row name="Box IoU" value={detail.box_iou?.toFixed(2) ?? "–"} />
        <Row name="Model" value={cad.name} />
        {cad.size_cm && <Row name="Size" value={`${cad.size_cm.map((cm) => cm.toFixed(0)).join(" × ")} cm`} />}
        <Row name="By" value={[cad.creator, cad.licence].filter(Boolean).join(", ") || "–"} />
      </dl>
      <Siblings detail={detail} />
      <div class="buttons">
        <CommandButton id="replace" icon="replace" label="Replace in the photo" />
      </div>
      <h3>History</h3>
      {detail.history.length === 0 ? (
        <p class="hint">Nobody has decided yet.</p>
      ) : (
        <ol class="history">
          {[...detail.history].reverse().map((happening) => (
            <Happened key={`${happening.at} ${happening.author}`} happening={happening} />
          ))}
        </ol>
      )}
    </section>
  );
}

function Row({ name, value }: { name: string; value: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}

function Siblings({ detail }: { detail: Detail }) {
  const { review } = useApp();
  if (detail.siblings.length < 2) return null;
  return (
    <p class="siblings">
      Objects in this photo:{" "}
      {detail.siblings.map((id, place) => (
        <button
          key={id}
          type="button"
          aria-current={id === detail.id ? "true" : undefined}
          onClick={() => void review.open(id)}
        >
          {place + 1}
          <span class="hidden"> {review.queue.item(id)?.category ?? ""}</span>
        </button>
      ))}
    </p>
  );
}

function Happened({ happening }: { happening: Happening }) {
  const { author, kind, at, verdict, reason, note, changed } = happening;
  const label = verdictLabel(verdict, kind === "human");
  return (
    <li>
      <b>{label}</b> by {author}
      {changed.length > 0 && <>, changed {changed.map((each) => WORDS[each] ?? each).join(", ")}</>}
      {(reason || note) && <q>{[reason, note].filter(Boolean).join(": ")}</q>}
      <time dateTime={at}>{new Date(at).toLocaleString()}</time>
    </li>
  );
}

const WORDS: Record<string, string> = { pose: "pose", cad: "model", region: "box and mask" };

function percent(share: number | null): string {
  return share === null ? "–" : `${Math.round(share * 100)} %`;
}

function standing(detail: Detail): string {
  if (!detail.in_force) return "history: another answer holds";
  const by = detail.decided_by === "human" ? ", by a person" : detail.decided_by === "program" ? ", by the program" : "";
  return `${verdictLabel(detail.verdict, detail.decided_by === "human")}${by}`;
}
